# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses of objects in contact with given members."""

from __future__ import annotations

from collections.abc import Sequence
import itertools
import math

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import (
    check_member_names,
    find_contacts,
    find_members,
    Grip,
    members_at,
)
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.model.shapes import Disc, Shape
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import finite_array
from isotruss_ros.core.numerics.tolerances import ROUNDING
import numpy as np


@check_kinds
def place_between(
    config: Configuration,
    members: Sequence[str],
    shape: Shape,
    angle: float = 0.0,
    indentation: float = 0.0,
) -> Grip:
    """
    Return the grip of an object that is placed with equal penetration of all given members.

    If several such poses exist, the pose nearest to the middle of the members is used. For three
    members, or parallel members, the penetrations are as equal as possible.

    :param config: configuration of the robot.
    :param members: names `t/j-k` of two or three members.
    :param shape: shape of the object.
    :param angle: angle of the object in the robot frame [rad].
    :param indentation: penetration into the undeformed skin of each member [m].
    :raises GraspError: the robot has no such members; a number is not finite; or the object does
        not fit between these members.
    """
    direction, depth = finite_array([angle, indentation], 2, 'angle, indentation', GraspError)
    names = check_member_names(members)
    starts, ends = config.points[find_members(config.robot.topology, names).lines.T]
    spans = ends - starts
    axes = spans / np.abs(spans)
    middle = complex((starts + 0.5 * spans).mean())
    turn = complex(math.cos(direction), math.sin(direction))
    skin = 0.5 * config.robot.description.tube_diameter - depth
    poses: list[tuple[Pose, tuple[float, ...]]] = []
    # The object may be on the left (+1) or on the right of each member.
    for sides in itertools.product((1.0, -1.0), repeat=len(names)):
        # Displacement (x, y) of an object from the middle that closes the gaps to all members.
        normals = -1j * np.array(sides) * axes
        distances = shape.support(normals / turn) + skin  # of the object's origin from the lines
        gaps = ((starts - middle) * normals.conj()).real - distances
        rows = normals.view(np.float64).reshape(-1, 2)
        x, y = np.linalg.lstsq(rows, gaps, rcond=ROUNDING)[0]
        pose = Pose(middle.real + float(x), middle.imag + float(y), float(direction))
        # A contact on a member is within reach of the object's origin.
        along = ((complex(pose.x, pose.y) - starts) * axes.conj()).real
        if ((along >= -shape.reach) & (along <= np.abs(spans) + shape.reach)).all():
            poses.append((pose, sides))
    # The nearest pose with the object on the assumed sides.
    poses.sort(key=lambda each: math.hypot(each[0].x - middle.real, each[0].y - middle.imag))
    for pose, sides in poses:
        grip = Grip(names, ConvexObject(shape, pose))
        try:
            contacts = find_contacts(config, grip)
        except GraspError:
            continue
        if all(contact.side == sides[contact.owner] for contact in contacts):
            return grip
    raise GraspError(
        f'an object that reaches {shape.reach:g} m does not fit between the members '
        f'{", ".join(names)}; choose another shape, angle, configuration or other members'
    )


@check_kinds
def tangent_center(
    config: Configuration, module: str, diameter: float, shift: float = 0.0
) -> tuple[float, float]:
    """
    Return the tangent center of a disc at a module, or the center shifted toward the corner.

    At the tangent center the disc touches both members of the module without pressing on them.

    :param config: configuration of the robot.
    :param module: name `t/j` of the module.
    :param diameter: diameter of the disc [m].
    :param shift: distance from the tangent center toward the corner of the two members [m]. The
        indentation of each member is this distance times the sine of half the angle between the
        members, 0.5 times at 60 degrees. For a given indentation see `place_between`.
    :return: (x, y) in the robot frame [m].
    :raises GraspError: the robot has no such module; the diameter is not positive; the shift is
        not finite; or the disc at its tangent center does not fit between the members.
    """
    (distance,) = finite_array([shift], 1, 'shift [m]', GraspError)
    grip = place_between(config, members_at(config.robot, module), Disc(diameter))
    toward = sum(contact.normal for contact in find_contacts(config, grip))
    center = grip.center + distance * toward / abs(toward)
    return center.real, center.imag
