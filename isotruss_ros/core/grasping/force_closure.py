# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Force closure: whether friction within its limits balances the rest, equation (10).

The wrenches that friction can bring about form a zonotope: a sum of segments, one for each
contact. Its facets are planes spanned by pairs of segments, so that the smallest friction
coefficient and the distance from opening follow without iteration. Moments are divided by half of
the object's mean width, the arm d/2 of friction at the surface of a cylinder, so that all three
components are forces.
"""

from __future__ import annotations

from dataclasses import dataclass
import functools

from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.qp import QuadraticProgram, solve_qp
import numpy as np
import scipy
from scipy.linalg import lapack

#: Closed when what is left is this small, against the forces involved.
CLOSURE_TOLERANCE = 1e-6
#: Facets whose normal is this short, against 1, are degenerate: their segments are parallel.
FACET_TOLERANCE = 1e-9
#: Weight of small friction forces against a small residual; in the end it must not show, so that
#: where friction suffices the balance is refined until it holds, at most so often.
REGULARIZATION = 1e-10
MAX_REFINEMENTS = 20
#: Steps of the descent before the quadratic program; where friction does not suffice, at most so
#: many contacts are between their bounds.
MAX_DESCENTS, FEW = 30, 2
EYE = np.eye(3)


@dataclass(frozen=True, eq=False)
class Closure:
    """
    How friction balances a wrench.

    :ivar closed: whether it does, up to `tolerance`.
    :ivar residual: what is left [N], moments over d/2.
    :ivar tolerance: below which the residual counts as none [N].
    :ivar friction_forces: (k,) along the tangents, counter-clockwise around the object [N].
    :ivar required_friction: smallest coefficient that closes; infinite if none does.
    :ivar margin: largest extra wrench of any direction that friction still balances [N]; negative
        where the grasp is open.
    """

    closed: bool
    residual: float
    tolerance: float
    friction_forces: Array
    required_friction: float
    margin: float


def check_force_closure(
    tangents: Array,
    normal_forces: Array,
    load: Array,
    friction: float,
    levers: Array | None = None,
) -> Closure:
    """
    Balance a load by friction forces with |F_i| <= mu N_i, equation (10).

    :param tangents: (k, 2) unit tangents of the object at the contacts, counter-clockwise.
    :param normal_forces: (k,) N_i, not negative [N].
    :param load: (3,) resultant of all else on the object: fx, fy, m / (d/2) [N].
    :param friction: mu, not negative.
    :param levers: (k,) of forces along the tangents, over half of the mean width; None for a
        cylinder, where they are 1.
    """
    touching = normal_forces > 0.0
    levers_here = np.ones(touching.sum()) if levers is None else levers[touching]
    segments = np.column_stack([tangents[touching], levers_here])
    segments = segments * normal_forces[touching, None]
    tolerance = CLOSURE_TOLERANCE * max(
        1e-3, float(np.abs(load).max()), float(normal_forces.sum())
    )
    facets = (_facets_of_cone if levers is None else _facets)(segments)
    required, margin = _extremes(facets, -load, friction, tolerance)
    shares, residual = _balance(segments, load, friction, np.zeros(len(segments)))
    for _ in range(MAX_REFINEMENTS):
        if residual <= 0.1 * tolerance or required > friction:
            break
        shares, residual = _balance(segments, load, friction, shares)
    forces = np.zeros(len(normal_forces))
    forces[touching] = shares * normal_forces[touching]
    return Closure(residual <= tolerance, residual, tolerance, forces, required, margin)


def _balance(segments: Array, load: Array, friction: float, shares: Array) -> tuple[Array, float]:
    """
    Return the shares (k,) in [-mu, mu] of the segments that balance the load best.

    :param shares: near which they are to be, where there is a choice.
    :return: also what is left of the load.
    """
    k = len(segments)
    if k == 0 or friction == 0.0:
        return np.zeros(k), float(np.linalg.norm(load))
    size = np.sqrt(np.einsum('ki,ki->k', segments, segments).max())
    scaled, target = segments / size, load / size
    found = _exchange(scaled, target, friction, shares)
    if found is None:
        found = _balance_by_qp(scaled, target, friction, shares)
    return found, float(np.linalg.norm(segments.T @ found + load))


def _exchange(segments: Array, load: Array, friction: float, shares: Array) -> Array | None:
    """
    Return the shares (k,) that balance the load best, by finding which of them are at bounds.

    Where friction suffices with room to spare none is at its bound. Where it does not, what is
    left of the load, r, has the least |r - load|^2 / 2 + mu sum |s_i r|: it comes to be at right
    angles to at most two segments s_i, and each of the others is at its bound against it. A
    descent with exact steps from plane to plane finds r. None if it does not, or nearly all of
    the load is balanced.
    """
    # Segments are of length one at most: with the regularization their squares can be factored.
    normal = segments.T @ segments + REGULARIZATION * EYE
    needed = lapack.dposv(normal, segments.T @ shares + load)[1]
    found = shares - segments @ needed
    if np.abs(found).max() <= friction:
        return found
    left = np.clip(found, -friction, friction) @ segments + load
    across = segments @ left
    signs, free = np.where(across < 0.0, -1.0, 1.0), list[int]()
    for _ in range(MAX_DESCENTS):
        found = -friction * signs
        found[free] = 0.0
        rest = found @ segments + load
        target = _at_right_angles(segments[free], rest)
        ahead, way = segments @ target, target - left
        crossing = np.flatnonzero(across * ahead < 0.0)
        if not len(crossing):
            if free:
                rows = segments[free]
                inner = rows @ rows.T + REGULARIZATION * EYE[: len(free), : len(free)]
                inside = lapack.dposv(inner, REGULARIZATION * shares[free] - rows @ rest)[1]
                size = np.abs(inside)
                if not size.max() < friction:
                    # One that would take more than there is does not stay between its bounds.
                    worst = int(size.argmax())
                    left, across = target, ahead
                    across[free] = 0.0
                    signs[free.pop(worst)] = -1.0 if inside[worst] > 0.0 else 1.0
                    continue
                found[free] = inside
            settled = _is_settled(found, free, signs, segments, load, friction)
            return found if settled else None
        step, plane = _find_step(across, ahead, crossing, float(way @ way), friction, signs)
        if plane is not None:
            free.append(plane)
        if len(free) > FEW:
            return None
        left, across = left + step * way, across + step * (ahead - across)
        across[free] = 0.0
    return None


def _find_step(
    across: Array, ahead: Array, crossing: Indices, slope: float, friction: float, signs: Array
) -> tuple[float, int | None]:
    """
    Return which share of a step leads to the least value on the way, and the plane that is there.

    :param across: (k,) s_i r where the step begins.
    :param ahead: (k,) where it leads.
    :param crossing: (c,) numbers of those that change their sign.
    :param slope: by which the value falls in the beginning, for the whole step.
    :param signs: (k,) of s_i r; those of the planes that are passed are turned around.
    """
    change = ahead[crossing] - across[crossing]
    places, rises = -across[crossing] / change, 2.0 * friction * np.abs(change)
    risen = 0.0
    for at, rise, i in sorted(
        zip(places.tolist(), rises.tolist(), crossing.tolist(), strict=True)
    ):
        left = slope * (1.0 - at)
        if risen >= left:
            break
        risen += rise
        if risen >= left:
            return at, i
        signs[i] = -signs[i]
    return 1.0 - risen / slope, None


def _at_right_angles(segments: Array, vector: Array) -> Array:
    """Return the part (3,) of a vector at right angles to no segment, to one or to two."""
    if len(segments) == 0:
        return vector
    if len(segments) == 1:
        (segment,) = segments
        return vector - (vector @ segment) / (segment @ segment) * segment
    (a, b, c), (u, v, w) = segments.tolist()
    normal = np.array([b * w - c * v, c * u - a * w, a * v - b * u])
    size = float(normal @ normal)
    return (vector @ normal) / size * normal if size > 0.0 else normal


def _is_settled(
    found: Array, free: list[int], signs: Array, segments: Array, load: Array, friction: float
) -> bool:
    """Return whether each share at a bound, all but the free ones, is against what is left."""
    pulls = (segments @ (found @ segments + load)) * signs
    pulls[free] = np.inf
    return bool(pulls.min() > 2.0 * REGULARIZATION * friction)


def _balance_by_qp(segments: Array, load: Array, friction: float, shares: Array) -> Array:
    """Return the shares (k,) that balance the load best, by a quadratic program."""
    k = len(segments)
    bound = np.full(k, friction)
    found = solve_qp(
        QuadraticProgram(
            segments @ segments.T + REGULARIZATION * np.eye(k),
            segments @ load - REGULARIZATION * shares,
            np.zeros((0, k)),
            np.zeros(0),
            -bound,
            bound,
        )
    )
    if found is None:
        # Loads far beyond all friction: the digits of the small term above are lost in them.
        found = scipy.optimize.lsq_linear(segments.T, -load, (-bound, bound), method='bvls').x
    return np.clip(found, -bound, bound)


def _extremes(
    facets: tuple[Array, Array], wanted: Array, friction: float, tolerance: float
) -> tuple[float, float]:
    """
    Return the smallest coefficient with which friction gives a wrench, and how far it is inside.

    :param facets: of what friction can give at coefficient 1.
    """
    normals, support = facets
    need = np.abs(normals @ wanted)
    # A flat zonotope, as of two contacts, reaches nothing across its plane.
    flat = support == 0.0
    if (need[flat] > tolerance).any():
        return np.inf, -float(need[flat].max())
    need, support = need[~flat], support[~flat]
    required = float((need / support).max(initial=0.0))
    margin = float((friction * support - need).min(initial=np.inf))
    return required, min(margin, 0.0) if flat.any() else margin


def _facets(segments: Array) -> tuple[Array, Array]:
    """
    Return unit normals of the facets of a zonotope, and its extent along them from the centre.

    :param segments: (k, 3).
    :return: (f, 3) and (f,); the extent is 0 across a zonotope that is flat.
    """
    first, second = _pairs(len(segments))
    normals = np.cross(segments[first], segments[second])
    sizes, reach = np.linalg.norm(normals, axis=1), np.linalg.norm(segments, axis=1)
    good = sizes > FACET_TOLERANCE * reach[first] * reach[second]
    normals = normals[good] / sizes[good, None]
    support = np.abs(normals @ segments.T).sum(axis=1)
    if (support > FACET_TOLERANCE * reach.sum()).any():
        return normals, support
    return _flat_facets(segments, bool(good.any()))


def _facets_of_cone(segments: Array) -> tuple[Array, Array]:
    """Return the same of segments on the cone x^2 + y^2 = z^2, z > 0: those of a cylinder."""
    k = len(segments)
    # The plane through two lines of the cone parts those between them from the others, around the
    # cone: sums over ranges take the place of sums over all, so that hundreds of contacts are few.
    segments = segments[np.argsort(np.arctan2(segments[:, 1], segments[:, 0]))]
    first, second = _pairs(k)
    (x, y, z), (u, v, w) = segments[first].T, segments[second].T
    normals = np.array([y * w - z * v, z * u - x * w, x * v - y * u])
    sizes = np.sqrt((normals * normals).sum(axis=0))
    reach = segments[:, 2]
    good = sizes > FACET_TOLERANCE * reach[first] * reach[second]
    normals, first, second = (normals[:, good] / sizes[good]).T, first[good], second[good]
    # The sum of those between less that of those outside; the two themselves are in neither.
    sums = np.cumsum(segments, axis=0)
    middle = 2.0 * sums - segments
    across = middle[second] - middle[first] - segments.sum(axis=0)
    support = np.abs(np.einsum('fi,fi->f', normals, across))
    if (support > FACET_TOLERANCE * reach.sum()).any():
        return normals, support
    return _flat_facets(segments, bool(good.any()))


def _flat_facets(segments: Array, plane: bool) -> tuple[Array, Array]:
    """
    Return the same of segments, (k, 3), that are all in one plane.

    :param plane: whether they are not all in one line.
    """
    rank = min(len(segments), 1 + plane)
    axes = np.linalg.svd(segments)[2]
    within = np.cross(segments, axes[2]) if rank == 2 else axes[:rank]
    within = within / np.linalg.norm(within, axis=1)[:, None]
    extent = np.abs(within @ segments.T).sum(axis=1)
    return np.concatenate([axes[rank:], within]), np.append(np.zeros(3 - rank), extent)


@functools.lru_cache(maxsize=64)
def _pairs(count: int) -> tuple[Indices, Indices]:
    """Return all pairs of numbers below a count: the smaller ones, and the larger ones."""
    return np.triu_indices(count, 1)
