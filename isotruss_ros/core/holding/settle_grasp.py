# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Equilibrium of a free object in a grasp: `settle_grasp`."""

from __future__ import annotations

from collections.abc import Sequence

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.holding.attach_grip import attach_grips
from isotruss_ros.core.holding.held_grip import (
    Equilibria,
    GraspInputs,
    HeldGrip,
    HoldStatus,
    NotHeldError,
)
from isotruss_ros.core.holding.overlaps import MAX_DISPLACEMENT, SKIN_TOLERANCE
from isotruss_ros.core.holding.settled_grasp import LostContact, SettledGrasp
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.manipulation.grip import check_member_names, find_members
from isotruss_ros.core.model.convex_object import check_load, ConvexObject
from isotruss_ros.core.model.pose import check_range, Pose
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import Array, Indices, MAX_MAGNITUDE
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.tolerances import ROUNDING
from isotruss_ros.core.statics.section import Pressure, tube_pressures
import numpy as np
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
    determines the squeeze. For other shapes and for three members see `least_friction`.

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
    body = body.smoothed(0.5 * config.robot.description.tube_diameter)
    indices = check_members(config.robot, members)
    checked = check_inputs(config, body, friction, external_wrench, pressure, indices, stiffness)
    return settle_inputs(*checked)


def check_members(robot: Mechanism, members: Sequence[str] | None) -> Indices | None:
    """Return the indices of grasping members given by their names; None if not given."""
    if members is None:
        return None
    return find_members(robot.topology, check_member_names(members)).members


def check_inputs(
    config: Configuration,
    body: ConvexObject,
    friction: float | None,
    external_wrench: ArrayLike,
    pressure: Pressure | None,
    members: Indices | None,
    stiffness: float,
) -> tuple[GraspInputs, float]:
    """Return the checked inputs of a grasp, and its coefficient of friction."""
    mu, wrench = check_load(body, friction, external_wrench)
    gauge = tube_pressures(config.robot.description, pressure)
    factor = check_range(stiffness, 'stiffness', '', 1.0 / MAX_MAGNITUDE, MAX_MAGNITUDE)
    return GraspInputs(config, body, members, wrench, gauge, factor), mu


def settle_inputs(inputs: GraspInputs, friction: float) -> SettledGrasp:
    """Return the settled grasp of checked inputs, see `settle_grasp`."""
    (grip,) = attach_grips([inputs])
    if isinstance(grip, StructureError):
        raise grip
    if isinstance(grip, NotHeldError):
        return lose_grasp(inputs, grip, friction)
    return assess_equilibrium(inputs.body.pose, grip, friction)


def lose_grasp(inputs: GraspInputs, error: NotHeldError, friction: float) -> SettledGrasp:
    """Return the settled grasp of an object without an equilibrium."""
    config, body = inputs.config, inputs.body
    reason, depths = str(error), member_depths(config, body)
    deepest = int(depths.argmax())
    if depths[deepest] > ROUNDING:
        name, depth = config.robot.member_names[deepest], depths[deepest]
        reason += f'; the object is {1e3 * depth:.3g} mm deep in {name}'
    lost = LostContact.of(inputs)
    return SettledGrasp(error.hold, reason, body.pose, friction, lost=lost)


def assess_equilibrium(given: Pose, grip: HeldGrip, friction: float) -> SettledGrasp:
    """Return the settled grasp at an equilibrium, with its hold status; `given` is its pose."""
    ((hold, reason),) = judge(grip.alone, [given], np.array([friction]))
    if hold not in (HoldStatus.NO_CONTACT, HoldStatus.OFF_MEMBER):
        return SettledGrasp(hold, reason, given, friction, grip)
    lost = LostContact.of(grip.inputs._replace(body=grip.body.moved_to(given)))
    return SettledGrasp(hold, reason, given, friction, lost=lost)


def judge(at: Equilibria, given: Sequence[Pose], friction: Array) -> list[tuple[HoldStatus, str]]:
    """
    Return the hold statuses of n equilibria, and the reasons in words; empty for a held object.

    The poses `given` and the coefficients of friction (n,) are those of the samples.
    """
    structure, used = at.g.structure, at.sections.used
    names, diameter = structure.config.robot.member_names, 2.0 * structure.tube_radius
    x, y, angles = np.array(given).T
    turned = np.exp(1j * angles) * at.g.bodies.shape.centroid
    shifts = np.abs(at.bodies.middle - (x + 1j * y + turned))
    others, depths = at.depths_in_others
    violations = {
        HoldStatus.NO_CONTACT: at.normal_forces.min(axis=-1) <= 0.0,
        HoldStatus.OFF_MEMBER: ~at.are_on_members,
        HoldStatus.FAR: shifts > MAX_DISPLACEMENT * diameter,
        HoldStatus.OTHER_CONTACT: depths.max(axis=1, initial=0.0)
        > SKIN_TOLERANCE * structure.tube_radius,
        HoldStatus.SLIPS: at.required_friction > friction,
        HoldStatus.UNSTABLE: ~at.response.stable,
        HoldStatus.WRINKLES: used.max(axis=1) > 1.0,
    }

    def detail(hold: HoldStatus, i: int) -> str:
        """Return the value that violates the condition of a sample."""
        if hold is HoldStatus.FAR:
            return f'{1e3 * shifts[i]:.3g} mm'
        if hold is HoldStatus.OTHER_CONTACT:
            return names[others[depths[i].argmax()]]
        if hold is HoldStatus.SLIPS:
            return f'coefficient {at.required_friction[i]:.3g} against {friction[i]:.3g}'
        if hold is HoldStatus.WRINKLES:
            worst = int(used[i].argmax())
            return f'{names[worst]} has {used[i, worst]:.3g} times its wrinkling moment'
        return ''

    verdicts = []
    # Columns: conditions in the order in which they are stated.
    for i, row in enumerate(zip(*(flags.tolist() for flags in violations.values()), strict=True)):
        hold = next((hold for hold, wrong in zip(violations, row, strict=True) if wrong), None)
        reason = '' if hold is None else ': '.join(filter(None, (hold.value, detail(hold, i))))
        verdicts.append((hold or HoldStatus.HELD, reason))
    return verdicts
