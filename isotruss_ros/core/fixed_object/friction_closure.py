# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Closure by friction: bounded friction balances the normal forces, equation (10).

The wrenches that friction can exert form a zonotope, the sum of one segment for each contact. Each
facet is spanned by a pair of segments, so the smallest friction coefficient and the closure margin
follow without iteration. Moments are divided by half of the object's mean width, d/2 of a
cylinder, so all three components are forces.
"""

from __future__ import annotations

from dataclasses import dataclass
import functools

from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.qp import find_nearest, solve_least_squares
from isotruss_ros.core.numerics.tolerances import NEGLIGIBLE_SHARE, ROUNDING
import numpy as np
import scipy

#: Number of facets that are computed at once [-].
FACET_BATCH = 4096

#: Returns the indices of the first and of the second of all pairs of a number of contacts, cached.
pairs = functools.lru_cache(maxsize=64)(np.triu_indices)


@dataclass(frozen=True, eq=False)
class FrictionClosure:
    """Closure by friction (10); moments are over d/2, half of the object's mean width."""

    closed: bool  #: whether the residual is at most `tolerance`
    residual: float  #: norm of the unbalanced wrench (fx, fy, m / (d/2)) [N]
    tolerance: float  #: largest residual that counts as closure [N]
    #: (k,) friction on the object along the tangents, counter-clockwise [N]
    friction_forces: Array
    required_friction: float  #: smallest coefficient of friction with closure; infinite if none
    #: largest norm of an additional wrench that friction balances in every direction [N]; negative
    #: if the load alone is not balanced
    margin: float


def balance_by_friction(
    tangents: Array, normal_forces: Array, load: Array, friction: float, levers: Array
) -> FrictionClosure:
    """
    Balance a load by friction forces with |F_i| <= mu N_i, equation (10).

    The load is the resultant (fx, fy, m / (d/2)) of the other forces on the object [N]. The unit
    tangents (k, 2) are counter-clockwise; their lever arms are divided by d/2 [-].
    """
    is_pressed = normal_forces > 0.0
    pressing = normal_forces[is_pressed]
    # Friction wrenches per coefficient of friction: their sums are a zonotope.
    segments = np.column_stack([tangents, levers])[is_pressed] * pressing[:, None]
    tolerance = NEGLIGIBLE_SHARE * max(1e-3, float(np.abs(load).max()), float(pressing.sum()))
    facets = _facets(segments)
    required, margin = _required_friction(facets, load, friction, tolerance)
    ratios, residual = _balance(segments, facets, load, friction)
    forces = np.zeros(len(normal_forces))
    forces[is_pressed] = ratios * pressing
    return FrictionClosure(residual <= tolerance, residual, tolerance, forces, required, margin)


def _balance(
    segments: Array, facets: tuple[Array, Array], load: Array, friction: float
) -> tuple[Array, float]:
    """Return ratios (k,) of friction to normal force that balance a load, and the residual [N]."""
    normals, support = facets
    # The residual is the point nearest to zero of the polyhedron of load + friction wrenches.
    both_sides = np.concatenate([normals, -normals])
    distances = friction * np.tile(support, 2) + both_sides @ load
    nearest = find_nearest(both_sides.T, distances, float(np.linalg.norm(load)), 0.0)
    unbalanced = np.zeros(3) if nearest is None else nearest.point
    # Friction is at its bound at each contact whose friction wrench has a component along the
    # residual. Only the ratios of the few contacts without such a component are unknown.
    components = segments @ unbalanced
    largest = np.linalg.norm(segments, axis=1) * np.linalg.norm(unbalanced)
    is_undetermined = np.abs(components) <= NEGLIGIBLE_SHARE * largest
    ratios = np.where(is_undetermined, 0.0, -friction * np.sign(components))
    if is_undetermined.any() and friction > 0.0:
        missing = unbalanced - load - ratios @ segments
        ratios[is_undetermined] = _smallest_ratios(segments[is_undetermined], missing, friction)
    return ratios, float(np.linalg.norm(segments.T @ ratios + load))


def _smallest_ratios(segments: Array, wrench: Array, friction: float) -> Array:
    """Return the smallest friction ratios (k,) that produce a wrench, or the closest wrench."""
    ratios = solve_least_squares(segments.T, wrench)
    if np.abs(ratios).max() <= friction:
        return ratios
    # Scaled, so that a load far beyond all friction does not overflow.
    size = max(float(np.abs(segments).max()), NEGLIGIBLE_SHARE * float(np.abs(wrench).max()))
    count = len(segments)
    return scipy.optimize.lsq_linear(
        np.concatenate([segments.T / size, NEGLIGIBLE_SHARE * np.eye(count)]),
        np.concatenate([wrench / size, np.zeros(count)]),
        (-friction, friction),
        method='bvls',
        tol=1e-14,
        max_iter=10 * count,
    ).x


def _required_friction(
    facets: tuple[Array, Array], load: Array, friction: float, tolerance: float
) -> tuple[float, float]:
    """Return the smallest coefficient of friction that balances a load, and the closure margin."""
    normals, support = facets
    along_normals = np.abs(normals @ load)
    # A planar zonotope, as of two contacts, balances no wrench perpendicular to its plane.
    is_flat = support == 0.0
    if (along_normals[is_flat] > tolerance).any():
        return np.inf, -float(along_normals[is_flat].max())
    along_normals, support = along_normals[~is_flat], support[~is_flat]
    required = float((along_normals / support).max(initial=0.0))
    margin = float((friction * support - along_normals).min(initial=np.inf))
    return required, min(margin, 0.0) if is_flat.any() else margin


def _facets(segments: Array) -> tuple[Array, Array]:
    """Return unit normals (f, 3) of a zonotope's facets, and their distances (f,)."""
    # Each facet is parallel to two segments.
    one, other = pairs(len(segments), 1)
    products = _cross(segments[one], segments[other])
    sizes, lengths = np.linalg.norm(products, axis=1), np.linalg.norm(segments, axis=1)
    is_plane = sizes > ROUNDING * lengths[one] * lengths[other]
    normals = products[is_plane] / sizes[is_plane, None]
    # The products of all pairs of hundreds of contacts with all contacts would take gigabytes.
    batches = np.array_split(normals, 1 + len(normals) // FACET_BATCH)
    support = np.concatenate([np.abs(batch @ segments.T).sum(axis=1) for batch in batches])
    if (support > ROUNDING * lengths.sum()).any():
        return normals, support
    # All segments are in one plane, on one line, or there is none.
    rank = min(len(segments), 2 if len(normals) else 1)
    return _flat_facets(segments, rank)


def _flat_facets(segments: Array, rank: int) -> tuple[Array, Array]:
    """Return facet normals and distances of a zonotope of rank 2, 1 or 0 (f, 3), (f,)."""
    axes = np.linalg.svd(segments)[2]  # those of the zonotope come first
    normals = _cross(segments, axes[2:]) if rank == 2 else axes[:rank]
    normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    support = np.abs(normals @ segments.T).sum(axis=1)
    return np.concatenate([axes[rank:], normals]), np.append(np.zeros(3 - rank), support)


def _cross(one: Array, other: Array) -> Array:
    """Return cross products (k, 3); `np.cross` takes four times as long."""
    return one[:, [1, 2, 0]] * other[:, [2, 0, 1]] - one[:, [2, 0, 1]] * other[:, [1, 2, 0]]
