# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Closing on an object that the ground holds: the members press on it as it lies, as in the paper.

They hold it only where their forces balance, so one is indented more and the other less until
friction balances the rest: Newton's method, with secant updates of the slopes. Two places of
contact: the wrenches that friction can bring about lie in a plane, next to flat, so what matters
is the load across it. Three: the resultant force of all.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from isotruss_ros.core.contact.analyze_grasp import analyze_grasp
from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis
from isotruss_ros.core.holding.settle_grasp import settle_grasp
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.numerics.arrays import Array, as_xy
from isotruss_ros.core.planning.closed_grip import (
    ClosedGrip,
    CLOSING_STEP,
    find_loads,
    LEAST_SHARE,
    REFINEMENT,
)
from isotruss_ros.core.planning.closing import Closing
from isotruss_ros.core.planning.closing_step import press
from isotruss_ros.core.planning.grasp_plan import SearchTally
from isotruss_ros.core.planning.requirements import GraspRequirements
import numpy as np
from numpy.typing import ArrayLike

#: Members balance where friction misses less than this share of their forces [-].
BALANCED = 0.003
#: Steps that balance the members at one mean indentation.
MAX_BALANCE_STEPS = 6
#: Deepest mean indentation, in diameters of the tube, and largest one of a member against the mean;
#: the inverse is the smallest.
MAX_DEPTH, MAX_SHARE = 0.8, 10.0


def close_on_ground(
    touch: Configuration, closing: Closing, needs: GraspRequirements, tally: SearchTally
) -> Iterator[ClosedGrip]:
    """
    Yield deeper and deeper grips, until a bound is reached.

    :param touch: configuration in which the members touch the object.
    :param closing: what closes.
    :param needs: what the grasp must fulfil.
    :param tally: of the search.
    :raises SolverError: a quadratic program, or the contact, was not solved.
    """
    config, depth, share = touch, 0.0, 1.0
    tube, shares = touch.robot.description.tube_diameter, np.ones(len(closing.members))
    while share > LEAST_SHARE and depth < MAX_DEPTH * tube:
        deeper = depth + share * CLOSING_STEP * tube
        found = _balance(config, closing, needs, tally, deeper, shares)
        grip = None if found is None else _judge(found[0], found[1], closing, needs, tally)
        if grip is None:
            share *= REFINEMENT
            continue
        config, _, shares = found
        depth = deeper
        yield grip


def _judge(
    config: Configuration,
    analysis: GraspAnalysis,
    closing: Closing,
    needs: GraspRequirements,
    tally: SearchTally,
) -> ClosedGrip | None:
    """Return a grip with what it does; None where a bound is exceeded."""
    settled = settle_grasp(config, closing.body, needs.friction, needs.external_wrench)
    bears = [*settled.utilisation.values()] if settled.hold.at_rest else []
    loads = find_loads(needs, analysis, [], bears, tally)
    if loads is None:
        return None
    margin = None
    if _closes(analysis, needs, tally):
        margin = settled.slip_margin if settled.held else 0.0
    mean = float(analysis.normal_forces.sum()) / len(closing.members)
    return ClosedGrip(config, closing.body, analysis, loads, mean, margin)


def _balance(
    config: Configuration,
    closing: Closing,
    needs: GraspRequirements,
    tally: SearchTally,
    depth: float,
    shares: Array,
) -> tuple[Configuration, GraspAnalysis, Array] | None:
    """
    Return the grip that balances best at a mean indentation, and its shares of that by member.

    :param shares: (s,) where to begin.
    :return: None where members cannot be brought to such indentations.
    """
    free = np.linalg.svd(np.ones((1, len(shares))))[2][1:].T  # what leaves the mean as it is
    slope: Array | None = None
    last: tuple[Array, Array] | None = None
    for _ in range(MAX_BALANCE_STEPS):
        pressed = press(config, closing, depth * shares, tally)
        if pressed is None:
            return None
        config = pressed
        tally.analyses += 1
        analysis = analyze_grasp(config, closing.body, needs.friction, needs.external_wrench)
        found = config, analysis, shares
        load = find_imbalance(config, closing, analysis, needs.external_wrench, depth * shares)
        total = float(analysis.normal_forces.sum())
        if load is None or np.abs(load.load).max() < BALANCED * total:
            break
        here = free.T @ (depth * shares)
        if slope is None or last is None:
            slope = load.slope @ free
        else:
            moved, secant = here - last[0], load.load - last[1]
            slope = slope + np.outer(secant - slope @ moved, moved) / (moved @ moved)
        last = here, load.load
        move = np.linalg.lstsq(slope, -load.load, rcond=None)[0]
        size = float(np.abs(move).max())
        shares = shares + free @ move * min(1.0, 0.5 * depth / size) / depth
        if shares.min() < 1.0 / MAX_SHARE or shares.max() > MAX_SHARE:
            break
    return found


def _closes(analysis: GraspAnalysis, needs: GraspRequirements, tally: SearchTally) -> bool:
    """Tell whether friction closes a grip with the margin that is wanted."""
    total = float(analysis.normal_forces.sum())
    friction, margin, least = analysis.required_friction, analysis.closure_margin, needs.min_margin
    if total == 0.0:
        tally.record('force_closure', 0.0, 1.0, 30.0)
    elif not analysis.force_closure or margin < 0.0:
        tally.record('force_closure', friction, needs.friction, 1.0 - margin / total)
    elif margin < least:
        tally.record('min_margin', margin, least, 1.0 - margin / least)
    else:
        return True
    return False


class Imbalance(NamedTuple):
    """
    What friction cannot take, in s - 1 directions for s members.

    :ivar load: (s - 1,) in these directions [N], moments over the arm of the object.
    :ivar slope: (s - 1, s) derivatives of the load by the indentations of the members [N/m].
    """

    load: Array
    slope: Array


def find_imbalance(
    config: Configuration,
    closing: Closing,
    analysis: GraspAnalysis,
    external_wrench: ArrayLike,
    depths: Array,
) -> Imbalance | None:
    """
    Return the load that friction cannot take, or None where a member does not press.

    :param config: configuration of the robot.
    :param closing: what presses on which object.
    :param analysis: of the grasp.
    :param external_wrench: (fx, fy, m) on the object [N, N m].
    :param depths: (s,) indentation of each member, positive [m].
    """
    body, names = closing.body, config.robot.member_names
    pressing = [analysis.contact_forces.get(names[i], 0.0) for i in closing.members]
    if min(pressing) <= 0.0:
        return None
    # As if each member were a spring of its own; the caller's secants correct it.
    stiffness = np.array(pressing) / depths
    inward = -closing.normals(config)
    model = np.stack([inward.real * stiffness, inward.imag * stiffness, np.zeros(len(inward))])
    wrench = np.asarray(external_wrench) + analysis.normal_wrench
    load = wrench / (1.0, 1.0, body.arm)
    if len(inward) > 2:
        return Imbalance(load[:2], model[:2])
    touching = analysis.normal_forces > 0.0
    normals = analysis.normals[touching]
    arms = analysis.points[touching] - as_xy(np.array([body.center]))
    moments = (arms * normals).sum(axis=1) / body.arm
    tangents = np.column_stack([-normals[:, 1], normals[:, 0], moments])
    across = np.linalg.svd(analysis.normal_forces[touching, None] * tangents)[2][2]
    slope = across @ model
    turn = 1.0 if slope[0] >= slope[1] else -1.0  # an axis has no sign: always the same one
    return Imbalance(turn * np.array([across @ load]), turn * slope[None])
