# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Force closure of many grasps at once: the steps of `check_force_closure`, equation (10)."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.grasping.force_closure import (
    check_force_closure,
    CLOSURE_TOLERANCE,
    FACET_TOLERANCE,
)
from isotruss_ros.core.numerics.arrays import Array, as_xy, Flags, Points
import numpy as np

#: Exchanges of what is at its bounds before a grasp is handed to `check_force_closure`.
MAX_EXCHANGES = 8
#: Weight of small friction forces against a small residual.
REGULARIZATION = 1e-12
EYE = np.eye(3)


class ClosureStack(NamedTuple):
    """
    How friction balances n wrenches; see `Closure`.

    :ivar closed: (n,) whether it does.
    :ivar residual: (n,) what is left [N].
    :ivar tolerance: (n,) below which the residual counts as none [N].
    :ivar required_friction: (n,) smallest coefficient that closes.
    :ivar margin: (n,) largest extra wrench that is still balanced [N].
    """

    closed: Flags
    residual: Array
    tolerance: Array
    required_friction: Array
    margin: Array


def check_closure_stack(
    tangents: Points, normal_forces: Array, load: Array, friction: float
) -> ClosureStack:
    """
    Balance loads by friction forces with |F_i| <= mu N_i, equation (10).

    What takes a search of its own `check_force_closure` does.

    :param tangents: (n, a) unit tangents of the objects, counter-clockwise, x + iy.
    :param normal_forces: (n, a), not negative; zero where a grasp has fewer contacts [N].
    :param load: (n, 3) resultants of all else: fx, fy, m / (d/2) [N].
    :param friction: mu, not negative.
    """
    reach = normal_forces
    segments = np.stack([reach * tangents.real, reach * tangents.imag, reach], axis=2)
    tolerance = CLOSURE_TOLERANCE * np.maximum(
        np.maximum(1e-3, np.abs(load).max(axis=1)), reach.sum(axis=1)
    )
    required, margin, plain = _extremes(segments, tangents, -load, friction, tolerance)
    residual, balanced = _balance(segments, load, friction)
    # Where friction would suffice the balance is refined until it holds.
    plain &= balanced & ((residual <= 0.1 * tolerance) | (required > friction))
    closed = residual <= tolerance
    for i in np.flatnonzero(~plain):
        one = check_force_closure(as_xy(tangents[i]), normal_forces[i], load[i], friction)
        closed[i], residual[i], tolerance[i] = one.closed, one.residual, one.tolerance
        required[i], margin[i] = one.required_friction, one.margin
    return ClosureStack(closed, residual, tolerance, required, margin)


def _balance(segments: Array, load: Array, friction: float) -> tuple[Array, Flags]:
    """Return what is left of the loads (n,), and where that is the least."""
    n = len(segments)
    if friction == 0.0:
        return np.linalg.norm(load, axis=1), np.ones(n, dtype=bool)
    size = np.sqrt((segments * segments).sum(axis=2).max(axis=1))
    touched = size > 0.0
    size = np.where(touched, size, 1.0)
    rows, target = segments / size[:, None, None], load / size[:, None]
    normal = rows.transpose(0, 2, 1) @ rows + REGULARIZATION * EYE
    found = -(rows @ np.linalg.solve(normal, target[:, :, None]))[:, :, 0]
    settled = ~touched | (np.abs(found).max(axis=1) <= friction)
    found = np.clip(found, -friction, friction)
    there = rows[:, :, 2] > 0.0
    pair = np.flatnonzero(~settled & (there.sum(axis=1) == 2))
    if len(pair):
        two = np.argsort(~there[pair], axis=1, kind='stable')[:, :2]
        found[pair[:, None], two] = _share_of_two(rows[pair[:, None], two], target[pair], friction)
        settled[pair] = True
    open_ = ~settled & touched
    # Where friction is far from enough all is at its bounds, each against what is left.
    for _ in range(MAX_EXCHANGES):
        left = np.flatnonzero(open_)
        if not len(left):
            break
        some = rows[left]
        rest = (some.transpose(0, 2, 1) @ found[left, :, None])[:, :, 0] + target[left]
        pull = (some @ rest[:, :, None])[:, :, 0]
        against = np.where(pull > 0.0, -friction, friction)
        wrong = there[left] & (found[left] != against)
        fine = ~wrong.any(axis=1)
        least = np.where(there[left], np.abs(pull), np.inf).min(axis=1)
        settled[left[fine]] = least[fine] > 2.0 * REGULARIZATION * friction
        open_[left[fine]] = False
        found[left] = np.where(wrong, against, found[left])
    remaining = (segments.transpose(0, 2, 1) @ found[:, :, None])[:, :, 0] + load
    return np.linalg.norm(remaining, axis=1), settled


def _share_of_two(rows: Array, load: Array, friction: float) -> Array:
    """Return the shares (n, 2), one at least at its bound, with which two segments do the most."""
    matrix = rows @ rows.transpose(0, 2, 1) + REGULARIZATION * EYE[:2, :2]
    slope = (rows @ load[:, :, None])[:, :, 0]
    own = matrix[:, [0, 1], [0, 1]]
    tried = []
    for at in (0, 1):
        for bound in (-friction, friction):
            other = -(slope[:, 1 - at] + matrix[:, 0, 1] * bound) / own[:, 1 - at]
            shares = np.full((len(rows), 2), bound)
            shares[:, 1 - at] = np.clip(other, -friction, friction)
            tried.append(shares)
    shares = np.stack(tried, axis=1)
    worth = ((0.5 * shares @ matrix + slope[:, None]) * shares).sum(axis=2)
    return shares[np.arange(len(rows)), worth.argmin(axis=1)]


def _extremes(
    segments: Array, tangents: Points, wanted: Array, friction: float, tolerance: Array
) -> tuple[Array, Array, Flags]:
    """Return required friction and margin (n,), and where the facets of a zonotope gave them."""
    normals, support, valid, plain = _facets(segments, tangents)
    need = np.abs((normals @ wanted[:, :, None])[:, :, 0])
    # A flat zonotope, as of two contacts, reaches nothing across its plane.
    flat = valid & (support == 0.0)
    across = np.where(flat, need, 0.0).max(axis=1)
    out = across > tolerance
    usual = valid & ~flat
    ratio = np.where(usual, need / np.where(usual, support, 1.0), 0.0)
    margin = np.where(usual, friction * support - need, np.inf).min(axis=1)
    margin = np.where(flat.any(axis=1), np.minimum(margin, 0.0), margin)
    required = np.where(out, np.inf, ratio.max(axis=1))
    return required, np.where(out, -across, margin), plain


def _facets(segments: Array, tangents: Points) -> tuple[Array, Array, Flags, Flags]:
    """
    Return unit normals of facets (n, f, 3), extents along them and which there are (n, f).

    :return: also for which zonotopes, (n,): not those of several contacts on one line.
    """
    n, count = segments.shape[:2]
    there = segments[:, :, 2] > 0.0
    order = np.argsort(np.where(there, np.angle(tangents), np.inf), axis=1)
    segments = np.take_along_axis(segments, order[:, :, None], axis=1)
    first, second = np.triu_indices(count, 1)
    normals = np.cross(segments[:, first], segments[:, second])
    sizes = np.linalg.norm(normals, axis=2)
    reach = segments[:, :, 2]
    good = sizes > FACET_TOLERANCE * reach[:, first] * reach[:, second]
    normals /= np.where(good, sizes, 1.0)[:, :, None]
    middle = 2.0 * np.cumsum(segments, axis=1) - segments
    whole = segments.sum(axis=1)[:, None]
    across = middle[:, second] - middle[:, first] - whole
    support = np.abs((normals * across).sum(axis=2))
    total = FACET_TOLERANCE * reach.sum(axis=1)
    solid = (good & (support > total[:, None])).any(axis=1)
    plane = ~solid & good.any(axis=1)
    # Of what is flat: across its plane, or its line, or any way where nothing touches; and in it.
    extra = np.zeros((n, max(3, count + 1), 3))
    extent, exists = np.zeros(extra.shape[:2]), np.zeros(extra.shape[:2], dtype=bool)
    touching = there.sum(axis=1)
    flat, line, none = (
        np.flatnonzero(~solid & which) for which in (plane, touching == 1, touching == 0)
    )
    extra[none, :3], exists[none, :3] = EYE, True
    if len(line):
        # One contact: the axes of its row alone.
        axes = np.linalg.svd(segments[line, :1])[2]
        extra[line, :3], exists[line, :3] = axes[:, [1, 2, 0]], True
        extent[line, 2] = np.abs((axes[:, 0] * segments[line, 0]).sum(axis=1))
    if len(flat):
        thin = segments[flat]
        axis = np.linalg.svd(thin)[2][:, 2]
        within = np.cross(thin, axis[:, None])
        size = np.linalg.norm(within, axis=2)
        within /= np.where(size > 0.0, size, 1.0)[:, :, None]
        extra[flat, 0], extra[flat, 1:] = axis, within
        extent[flat, 1:] = np.abs(within @ thin.transpose(0, 2, 1)).sum(axis=2)
        exists[flat, 0], exists[flat, 1:] = True, size > 0.0
    return (
        np.concatenate([normals, extra], axis=1),
        np.concatenate([support, extent], axis=1),
        np.concatenate([good & solid[:, None], exists], axis=1),
        solid | plane | (touching < 2),
    )
