# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Equilibrium of a free object in a grasp: `settle_grasp`."""

from __future__ import annotations

from collections.abc import Sequence

from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.contact_search import depths_in_others, skin_tolerance
from isotruss_ros.core.holding.held_grip import (
    GraspInputs,
    HeldGrip,
    HoldStatus,
    MAX_DISPLACEMENT,
    NotHeldError,
)
from isotruss_ros.core.holding.settled_grasp import LostContact, SettledGrasp
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.manipulation.grip import check_member_names, find_members
from isotruss_ros.core.model.convex_object import check_load, ConvexObject
from isotruss_ros.core.model.pose import check_range, Pose
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import MAX_MAGNITUDE
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.statics.section import Pressure, tube_pressures
from numpy.typing import ArrayLike


@check_kinds
@single_threaded
def settle_grasp(
    config: Configuration,
    body: ConvexObject,
    friction: float | None = None,
    external_wrench: ArrayLike = (0.0, 0.0, 0.0),
    pressure: Pressure | None = None,
    members: Sequence[str] | None = None,
    stiffness: float = 1.0,
) -> SettledGrasp:
    """
    Return the equilibrium of a grasped object near its measured pose.

    The object is free, friction acts on the tubes, and the contact history (how the contacts
    rolled before) is unknown. For a disc between two members, statics determines the friction
    forces and the position across the members' bisector. The measured position along the bisector
    determines the squeeze. For other shapes and for three members see `least_friction_conditions`.

    :param config: configuration of the robot, with rollers at rest.
    :param body: the object at its measured pose.
    :param friction: coefficient of friction between tube and object, not negative. If None, the
        coefficient of the object is used, or 0.5 if the object has none.
    :param external_wrench: (fx, fy, m) on the object about the origin of its frame [N, N m].
    :param pressure: gauge pressure [Pa], see `tube_pressures`; None: the pressure of the robot
        file.
    :param members: names `t/j-k` of the two or three grasping members; None: the members that the
        object overlaps, or if it overlaps fewer than two, the two nearest.
    :param stiffness: factor on EA, EI and GA of the tubes [-].
    :raises GraspError: an argument is invalid.
    :raises StructureError: a pressure is invalid, the robot is a mechanism, or its stiffness laws
        contradict each other.
    """
    mu, wrench = check_load(body, friction, external_wrench)
    body = body.smoothed(0.5 * config.robot.description.tube_diameter)
    indices = None
    if members is not None:
        names = check_member_names(members)
        indices = find_members(config.robot.topology, names).members
    gauge = tube_pressures(config.robot.description, pressure)
    factor = check_stiffness(stiffness)
    return settle_inputs(GraspInputs(config, body, indices, wrench, gauge, factor), mu)


def check_stiffness(value: float) -> float:
    """Return a checked factor on the stiffness of the tubes [-]."""
    return check_range(value, 'stiffness', '', 1.0 / MAX_MAGNITUDE, MAX_MAGNITUDE)


def settle_inputs(inputs: GraspInputs, friction: float) -> SettledGrasp:
    """Return the settled grasp of checked inputs, see `settle_grasp`."""
    config, body = inputs.config, inputs.body
    try:
        grip = attach_grip(*inputs)
    except NotHeldError as error:
        lost = LostContact.of(inputs)
        reason, depths = str(error), member_depths(config, body)
        deepest = int(depths.argmax())
        if depths[deepest] > 0.0:
            name, depth = config.robot.member_names[deepest], depths[deepest]
            reason += f'; the object is {1e3 * depth:.3g} mm deep in {name}'
        return SettledGrasp(error.hold, reason, body.pose, friction, lost=lost)
    return assess_equilibrium(body.pose, grip, friction)


def assess_equilibrium(given: Pose, grip: HeldGrip, friction: float) -> SettledGrasp:
    """Return the settled grasp at an equilibrium, with its hold status."""
    hold, detail = _judge(grip, given, friction)
    reason = '' if hold is HoldStatus.HELD else ': '.join(filter(None, (hold.value, detail)))
    if hold not in (HoldStatus.NO_CONTACT, HoldStatus.OFF_MEMBER):
        return SettledGrasp(hold, reason, given, friction, grip)
    lost = LostContact.of(grip.inputs._replace(body=grip.body.moved_to(given)))
    return SettledGrasp(hold, reason, given, friction, lost=lost)


def _judge(grip: HeldGrip, given: Pose, friction: float) -> tuple[HoldStatus, str]:
    """Return the hold status of an equilibrium, and the value that violates its condition."""
    robot, hold = grip.config.robot, grip.hold(friction)
    if hold in (HoldStatus.NO_CONTACT, HoldStatus.OFF_MEMBER):
        return hold, ''
    shift = abs(grip.body.middle - grip.body.moved_to(given).middle)
    if shift > MAX_DISPLACEMENT * robot.description.tube_diameter:
        return HoldStatus.FAR, f'{1e3 * shift:.3g} mm'
    others, depths = depths_in_others(grip)
    if depths.max(initial=0.0) > skin_tolerance(grip):
        return HoldStatus.OTHER_CONTACT, robot.member_names[others[depths.argmax()]]
    if hold is HoldStatus.SLIPS:
        return hold, f'coefficient {grip.required_friction:.3g} against {friction:.3g}'
    if grip.response is None or not grip.response.stable:
        return HoldStatus.UNSTABLE, ''
    used = grip.sections.used
    worst = int(used.argmax())
    if used[worst] > 1.0:
        times = f'{used[worst]:.3g} times its wrinkling moment'
        return HoldStatus.WRINKLES, f'{robot.member_names[worst]} has {times}'
    return HoldStatus.HELD, ''
