# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Actuators and sensors of an exported MuJoCo model, named after rollers, joints and objects.

A roller is a slide joint with the roller's name; its position is the roller travel. The rest
length of a member changes by phi_i - phi_j, the difference of the travels at its ends. So the
stiffness and damping of each elastic slide joint with position q, in a segment that is the
fraction s of the member, are moved to a fixed tendon with the length q - s (phi_i - phi_j).
"""

from __future__ import annotations

import xml.etree.ElementTree as ET

from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.numerics.arrays import Indices

#: Assumed moving mass of a roller without the tubes [kg].
ROLLER_MASS = 0.1
#: Stiffness [N/m] and damping [N s/m] of a position-controlled drive, which is stiff compared with
#: the axial stiffness of a tube, 1e4 to 1e5 N/m.
DRIVE_STIFFNESS, DRIVE_DAMPING = 1e6, 1e3
#: Largest travel of a roller [m].
MAX_TRAVEL = 100.0
#: Attributes of an elastic slide joint that are moved to its tendon.
TENDON_ATTRIBUTES = ('stiffness', 'damping')


def add_actuation(root: ET.Element, robot: Robot, objects: int, segments: Indices) -> None:
    """
    Add a joint, an actuator and sensors for each roller, and sensors for joints and objects.

    :param root: root element of the model of the robot at home, see `export_mjcf`.
    :param robot: the robot.
    :param objects: number of objects in the model.
    :param segments: (m,) number of segments of each member.
    """
    world, tendon = root.find('worldbody'), root.find('tendon')
    actuators = ET.SubElement(root, 'actuator')
    sensors = ET.SubElement(root, 'sensor')
    for name in robot.roller_names:
        body = ET.SubElement(world, 'body', name=f'{name}:roller')
        ET.SubElement(
            body, 'inertial', pos='0 0 0', mass=f'{ROLLER_MASS:g}', diaginertia='1e-3 1e-3 1e-3'
        )
        ET.SubElement(body, 'joint', name=name, type='slide', axis='1 0 0')
        ET.SubElement(
            actuators,
            'intvelocity',
            name=name,
            joint=name,
            kp=f'{DRIVE_STIFFNESS:g}',
            kv=f'{DRIVE_DAMPING:g}',
            actrange=f'-{MAX_TRAVEL:g} {MAX_TRAVEL:g}',
            ctrlrange=f'-{robot.description.max_speed:g} {robot.description.max_speed:g}',
        )
        ET.SubElement(sensors, 'jointpos', name=name, joint=name)
        ET.SubElement(sensors, 'jointvel', name=f'{name}:velocity', joint=name)
    _couple(root, tendon, robot, segments)
    for part in (*robot.topology.joint_names, *(f'object{n}' for n in range(objects))):
        ET.SubElement(sensors, 'framepos', name=part, objtype='xbody', objname=part)
    for number in range(objects):
        part = f'object{number}'
        turn = {'name': f'{part}:orientation', 'objtype': 'xbody', 'objname': part}
        ET.SubElement(sensors, 'framequat', turn)


def _couple(root: ET.Element, tendon: ET.Element, robot: Robot, segments: Indices) -> None:
    """Couple the rest lengths of the members to the rollers."""
    topology = robot.topology
    joints = {joint.get('name'): joint for joint in root.iter('joint')}
    for i, name in enumerate(topology.module_names):
        count = int(segments[i])
        for piece in range(1, count + 2):
            slide = joints[f'{name}:x{piece}']
            moved = {key: slide.attrib.pop(key) for key in TENDON_ATTRIBUTES}
            fixed = ET.SubElement(tendon, 'fixed', moved, name=slide.get('name'), springlength='0')
            ET.SubElement(fixed, 'joint', joint=slide.get('name'), coef='1')
            share = (0.5 if piece in (1, count + 1) else 1.0) / count
            for roller, change in zip(
                robot.roller_names, topology.incidence[i].tolist(), strict=True
            ):
                if change:
                    coef = f'{-share * change:.12g}'
                    ET.SubElement(fixed, 'joint', joint=roller, coef=coef)
