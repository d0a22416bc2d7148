# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Closing on an object that the ground holds: the members press on it as it lies, as in the paper.

They hold it only where their forces balance, so one is indented more and the other less until
friction balances the rest. Two places of contact: the wrenches that friction can bring about lie
in a plane, next to flat, so what matters is the load across it. Three: the resultant force of all.
"""

from __future__ import annotations

from collections.abc import Iterator

from isotruss_ros.core.contact.analyze_grasp import analyze_grasp
from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis
from isotruss_ros.core.holding.settle_grasp import settle_grasp
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.numerics.arrays import Array, as_xy
from isotruss_ros.core.planning.closing import Closing, CLOSING_STEP, LEAST_SHARE, REFINEMENT
from isotruss_ros.core.planning.closing_step import press
from isotruss_ros.core.planning.grasp_plan import ClosedGrip
from isotruss_ros.core.planning.requirements import GraspRequirements
from isotruss_ros.core.planning.violations import RequirementError
import numpy as np
from numpy.typing import ArrayLike

#: Members balance where friction misses less than this share of their forces [-].
BALANCED = 0.002
#: Steps that balance the members at one mean indentation.
MAX_BALANCE_STEPS = 6
#: A member's force changes by about so much less than its indentation: the frame gives, too [-].
GIVE = 2.3
#: Deepest mean indentation, in diameters of the tube.
MAX_DEPTH = 0.8


def close_on_ground(
    touch: Configuration, closing: Closing, needs: GraspRequirements
) -> Iterator[ClosedGrip]:
    """
    Yield deeper and deeper grips, until a bound is reached.

    :param touch: configuration in which the members touch the object.
    :param closing: what closes.
    :param needs: what the grasp must fulfil.
    :raises SolverError: a quadratic program, or the contact, was not solved.
    """
    config, depth, share = touch, 0.0, 1.0
    tube, shares = touch.robot.description.tube_diameter, np.ones(len(closing.members))
    while share > LEAST_SHARE and depth < MAX_DEPTH * tube:
        deeper = depth + share * CLOSING_STEP * tube
        with closing.tally.recording():
            grip, depths = _balance(config, deeper * shares, closing, needs)
            yield grip
            config, depth, shares = grip.config, deeper, depths / deeper
            continue
        share *= REFINEMENT


def _judge(
    config: Configuration, analysis: GraspAnalysis, closing: Closing, needs: GraspRequirements
) -> ClosedGrip:
    """Return a grip with what it does, unless a bound is exceeded."""
    settled = settle_grasp(config, closing.body, needs.friction, needs.external_wrench)
    bears = [*settled.utilisation.values()] if settled.hold.at_rest else []
    loads = needs.find_loads(analysis, [], bears)
    slip = None
    with closing.tally.recording():
        _check_closure(analysis, needs)
        slip = settled.slip_margin if settled.held else 0.0
    mean = float(analysis.normal_forces.sum()) / len(closing.members)
    return ClosedGrip(config, closing.body, analysis, loads, mean, slip)


def _check_closure(analysis: GraspAnalysis, needs: GraspRequirements) -> None:
    """Raise unless friction holds the object fast, with the margin that is required."""
    if not analysis.normal_forces.any():
        raise RequirementError('grip', 0.0, 2.0)
    if not analysis.closed_by_friction or analysis.closure_margin < 0.0:
        raise RequirementError('closed_by_friction', analysis.required_friction, needs.friction)
    needs.check_bound('min_margin', analysis.closure_margin)


def _balance(
    config: Configuration, depths: Array, closing: Closing, needs: GraspRequirements
) -> tuple[ClosedGrip, Array]:
    """Return the grip that balances best about some depths (s,), the mean kept, and its depths."""
    mean, names = depths.mean(), [config.robot.member_names[i] for i in closing.members]
    for _ in range(MAX_BALANCE_STEPS):
        config, used = press(config, closing, depths), depths
        closing.tally.analyses += 1
        analysis = analyze_grasp(config, closing.body, needs.friction, needs.external_wrench)
        forces = np.array([analysis.contact_forces.get(name, 0.0) for name in names])
        if forces.min() <= 0.0:
            break
        change = find_correction(config, closing, analysis, needs.external_wrench)
        if np.abs(change).max() < BALANCED * forces.sum():
            break
        depths = depths * np.clip(1.0 + GIVE * change / forces, 0.5, 2.0)
        depths = depths * (mean / depths.mean())
    return _judge(config, analysis, closing, needs), used


def find_correction(
    config: Configuration, closing: Closing, analysis: GraspAnalysis, external_wrench: ArrayLike
) -> Array:
    """
    Return the changes (s,) of normal forces, zero in sum, that balance what friction cannot take.

    :param config: configuration of the robot.
    :param closing: what presses on which object.
    :param analysis: of the grasp, in which all members press.
    :param external_wrench: (fx, fy, m) on the object [N, N m].
    """
    body, inward = closing.body, -closing.normals(config)
    axes = np.eye(3)[:2]
    if len(inward) == 2:
        touching = analysis.normal_forces > 0.0
        normals, forces = analysis.normals[touching], analysis.normal_forces[touching, None]
        arms = analysis.points[touching] - as_xy(np.array([body.center]))
        moments = (arms * normals).sum(axis=1) / body.arm
        tangents = np.column_stack([-normals[:, 1], normals[:, 0], moments])
        axes = np.linalg.svd(forces * tangents)[2][2:]
    load = (np.asarray(external_wrench) + analysis.normal_wrench) / (1.0, 1.0, body.arm)
    model = np.stack([inward.real, inward.imag, np.zeros(len(inward))])
    rows = np.vstack([axes @ model, np.ones(len(inward))])
    return np.linalg.solve(rows, np.append(-axes @ load, 0.0))
