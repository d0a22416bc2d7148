# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Unilateral contact of round tubes in many grasps at once: the steps of `solve_contact`."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.grasping.contact import MAX_NORMAL_UPDATES, SMOOTH
from isotruss_ros.core.grasping.lcp import GAP_TOLERANCE
from isotruss_ros.core.grasping.point_stack import PointStack, Touches
from isotruss_ros.core.model.shapes import normalize
from isotruss_ros.core.numerics.arrays import Array, Flags, Points
from isotruss_ros.core.statics.frame_stack import LoadedStack
import numpy as np

#: Grasps that do not settle in so many steps are left to `solve_contact`.
MAX_STEPS = 9


class ContactStack(NamedTuple):
    """
    Where objects are touched, in n grasps with c points in all.

    :ivar settled: (n,) whether the contact was found; the other grasps have no forces.
    :ivar forces: (c,) normal forces, not negative [N].
    :ivar arms: (c,) from the object's centre to the deformed points, x + iy [m].
    """

    settled: Flags
    forces: Array
    arms: Points


def solve_contact_stack(points: PointStack, loaded: LoadedStack, radius: Array) -> ContactStack:
    """
    Solve (8) for many grasps.

    :param points: that the objects could touch, of all grasps.
    :param loaded: how the frames give at the pieces that these are on.
    :param radius: (n,) of the discs that the points meet [m].
    """
    n = len(points.counts)
    settled = np.zeros(n, dtype=bool)
    forces, arms = np.zeros(len(points.points)), points.points.copy()
    numbers, grasps = np.arange(len(points.grasp)), np.arange(n)
    normals = normalize(points.points)
    gaps = (points.points * normals.conj()).real - radius[points.grasp]
    active = gaps <= _deepest(points, gaps)
    for number in range(MAX_STEPS):
        if not len(grasps):
            break
        # Most settle at once: at first, those that do not are only left for the next step.
        first = number == 0
        step = _step(points, loaded, grasps, radius[grasps], normals, active, first)
        done = step.done[points.grasp]
        forces[numbers[done]], arms[numbers[done]] = step.forces[done], step.arms[done]
        settled[grasps[step.done]] = True
        numbers, normals, active = numbers[~done], step.normals[~done], step.active[~done]
        left = np.flatnonzero(~step.done)
        grasps, points = grasps[left], points.take(left)
    return ContactStack(settled, forces, arms)


class _Step(NamedTuple):
    """
    Where a step of the search has led.

    :ivar done: (n,) which grasps have settled.
    :ivar forces: (c,) normal forces in these [N].
    :ivar arms: (c,) from the object's centre to the deformed points there [m].
    :ivar normals: (c,) along which the next step looks for forces in the others.
    :ivar active: (c,) where it looks for them.
    """

    done: Flags
    forces: Array
    arms: Points
    normals: Points
    active: Flags


def _step(
    points: PointStack,
    loaded: LoadedStack,
    grasps: Array,
    radius: Array,
    normals: Points,
    active: Flags,
    only_look: bool,
) -> _Step:
    """Close the gaps of active points, exchange what is wrong, and look whether all is well."""
    touches = Touches(points, loaded, grasps, active)
    away, disc = points.points, radius[points.grasp]
    push = _closing_forces(touches, points, normals, radius)
    pressed = np.zeros(len(active))
    pressed[touches.place[touches.used]] = push[touches.used]
    # (6), (8): no force pulls, no gap is negative.
    gaps = ((away + touches.displace(push * normals[touches.place])) * normals.conj()).real - disc
    wrong = (active & (pressed < 0.0)) | (~active & (gaps < -0.1 * GAP_TOLERANCE))
    complete = np.bincount(points.grasp, wrong, minlength=len(grasps)) == 0.0

    settled = _settled_forces(touches, points, normals, radius)
    done, forces, _, arms = _look(touches, points, settled, radius)
    each = np.zeros(len(active))
    each[touches.place[touches.used]] = forces[touches.used]
    if only_look:
        return _Step(done & complete, each, arms, normals, active)
    again, *other = _look(touches, points, push * normals[touches.place], radius)
    second = ~done & again
    each[touches.place[touches.used]] = np.where(second[:, None], other[0], forces)[touches.used]
    arms = np.where(second[points.grasp], other[2], arms)
    done = (done | second) & complete
    # Where nothing was wrong but the normals, these follow.
    normals = np.where(complete[points.grasp], other[1], normals)
    return _Step(done, each, arms, normals, active ^ wrong)


def _look(
    touches: Touches, points: PointStack, push: Points, radius: Array
) -> tuple[Flags, Array, Points, Points]:
    """Return whose forces fulfil (5) to (7), these, their normals, and where points are."""
    n = len(radius)
    moved = points.points + touches.displace(push)
    turned = normalize(moved)
    gaps = np.abs(moved) - radius[points.grasp]  # (5)
    pressing = push * turned[touches.place].conj()
    closed = np.where(touches.used, gaps[touches.place], -np.inf).max(axis=1) <= GAP_TOLERANCE
    least = np.full(n, np.inf)
    some = np.flatnonzero(points.counts)
    least[some] = np.minimum.reduceat(gaps, points.first[some])
    good = (
        closed
        & (least >= -GAP_TOLERANCE)
        & (pressing.real.min(axis=1) >= 0.0)
        & (np.abs(pressing.imag).max(axis=1) <= SMOOTH * np.abs(push).max(axis=1))
    )
    return good, pressing.real, turned, moved


def _closing_forces(touches: Touches, points: PointStack, normals: Points, radius: Array) -> Array:
    """Return the forces (n, a), of any sign, that close the gaps along normals."""
    normal = normals[touches.place]
    local = touches.axis.conj() * normal
    gaps = (points.points[touches.place] * normal.conj()).real - radius[:, None]
    _, forces = _press(touches, local, gaps)
    return forces


def _press(touches: Touches, local: Points, gaps: Array) -> tuple[Array, Array]:
    """Return motions (n, 2, a, a) of points under forces along normals, and what closes gaps."""
    along, across = local.real, local.imag
    moving = touches.compliance[:, :, :, 0] * along[:, None, None]
    moving += touches.compliance[:, :, :, 1] * across[:, None, None]
    matrix = along[:, :, None] * moving[:, 0] + across[:, :, None] * moving[:, 1]
    both = touches.used[:, :, None] & touches.used[:, None, :]
    matrix = np.where(both, matrix, np.eye(len(gaps[0])))
    forces = np.linalg.solve(matrix, np.where(touches.used, -gaps, 0.0)[:, :, None])[:, :, 0]
    return moving, forces


def _settled_forces(
    touches: Touches, points: PointStack, normals: Points, radius: Array
) -> Points:
    """Return the forces (n, a), x + iy, that close the gaps along normals that follow."""
    turn = touches.axis.conj()
    away, local = turn * points.points[touches.place], turn * normals[touches.place]
    forces = np.zeros_like(local)
    moving_on = np.ones(len(local), dtype=bool)
    for _ in range(MAX_NORMAL_UPDATES):
        gaps = (away * local.conj()).real - radius[:, None]
        moving, pressing = _press(touches, local, gaps)
        moved = moving @ pressing[:, None, :, None]
        turned = normalize(away + moved[:, 0, :, 0] + 1j * moved[:, 1, :, 0])
        forces = np.where(moving_on[:, None], pressing * local, forces)
        change = np.where(touches.used, np.abs(turned - local), 0.0).max(axis=1)
        local = np.where(moving_on[:, None], turned, local)
        moving_on &= ~(change < 0.01 * SMOOTH)
        if not moving_on.any():
            break
    return touches.axis * forces


def _deepest(points: PointStack, gaps: Array) -> Array:
    """Return the smallest gap on the member of each point, (c,)."""
    key = points.grasp * (1 + int(points.member.max(initial=0))) + points.member
    deepest = np.full(int(key.max(initial=-1)) + 1, np.inf)
    np.minimum.at(deepest, key, gaps)
    return deepest[key]
