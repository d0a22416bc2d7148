# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Visual elements of a MuJoCo model that touch nothing: ground, light, joints, outlines."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.model.convex_object import ConvexObject
import numpy as np

#: Colours of tubes, modules and objects.
TUBE_COLOR, MODULE_COLOR, OBJECT_COLOR = '0.25 0.5 0.75 1', '0.2 0.2 0.2 1', '0.85 0.45 0.15 1'
MARK_COLOR = '1 1 1 1'
#: Radius of the ball drawn at a joint [m]; and group of the colliding geoms, which viewers hide by
#: default.
BALL_RADIUS, COLLISION_GROUP = 0.03, '3'
#: Depth of the ground below the tubes, and its half width [m].
GROUND_DEPTH, GROUND_HALF_WIDTH = 0.01, 10.0
#: Spacing of an object's outline points relative to its characteristic radius [-].
OUTLINE_SPACING = 0.05
#: Mark of an object's orientation: length relative to the characteristic radius [-], and radius
#: [m].
MARK_LENGTH, MARK_RADIUS = 0.9, 0.008


def add_scenery(root: ET.Element, world: ET.Element, robot: Robot) -> None:
    """
    Add light and the ground below the plane of the robot.

    :param root: root element of the model.
    :param world: element of the model's bodies.
    :param robot: the robot.
    """
    visual, asset = ET.SubElement(root, 'visual'), ET.SubElement(root, 'asset')
    ET.SubElement(visual, 'global', offwidth='1280', offheight='960')
    # Half the width of the shadow area, which covers the reach of the robot.
    reach = float(np.ptp(robot.home.points.real) + np.ptp(robot.home.points.imag))
    middle = robot.home.points.mean()
    center = f'{middle.real:.6g} {middle.imag:.6g} 0'
    ET.SubElement(root, 'statistic', center=center, extent=f'{0.5 * reach:.6g}')
    ET.SubElement(visual, 'quality', shadowsize='2048', offsamples='2')
    soft = {'ambient': '0.35 0.35 0.35', 'diffuse': '0.15 0.15 0.15', 'specular': '0 0 0'}
    ET.SubElement(visual, 'headlight', soft)
    colors = {'rgb1': '0.93 0.93 0.91', 'rgb2': '0.86 0.86 0.84'}
    checks = {'type': '2d', 'builtin': 'checker', 'width': '256', 'height': '256', **colors}
    ET.SubElement(asset, 'texture', checks, name='ground')
    ET.SubElement(
        asset, 'material', name='ground', texture='ground', texuniform='true', specular='0'
    )
    lamp = {'pos': f'{middle.real - 2.0:.6g} {middle.imag + 2.0:.6g} 8', 'dir': '0.25 -0.25 -1'}
    ET.SubElement(world, 'light', lamp, cutoff='40', exponent='0', diffuse='0.45 0.45 0.45')
    height = 0.5 * robot.description.tube_diameter + GROUND_DEPTH
    plane = {
        'type': 'plane',
        'pos': f'0 0 {-height:.6g}',
        'size': f'{GROUND_HALF_WIDTH:g} {GROUND_HALF_WIDTH:g} 0.1',
    }
    ET.SubElement(world, 'geom', plane, name='ground', material='ground')


def add_look(root: ET.Element, body: ET.Element, held: ConvexObject, thickness: float) -> None:
    """
    Add a visible plate with the object's outline, and a mark of its orientation.

    :param root: root element of the model.
    :param body: element of the object's body.
    :param held: the object at its pose.
    :param thickness: thickness of the plate [m].
    """
    name, half = body.get('name'), 0.5 * thickness
    outline = held.outline(OUTLINE_SPACING * held.arm) - held.center
    corners = [f'{p.real:.6g} {p.imag:.6g} {z:.6g}' for z in (-half, half) for p in outline]
    (asset,) = root.iter('asset')
    ET.SubElement(asset, 'mesh', name=name, vertex='  '.join(corners))
    ET.SubElement(body, 'geom', type='mesh', mesh=name, rgba=OBJECT_COLOR)
    middle = held.middle - held.center
    tip = middle + MARK_LENGTH * held.arm * held.turn
    ends = np.array([[middle.real, middle.imag, half], [tip.real, tip.imag, half]])
    mark = ' '.join(f'{value:.6g}' for value in ends.ravel())
    ET.SubElement(
        body, 'geom', type='capsule', fromto=mark, size=f'{MARK_RADIUS:g}', rgba=MARK_COLOR
    )
