"""
Force closure: whether friction within its limits balances the rest, equation (10).

The wrenches that friction can bring about form a zonotope: a sum of segments, one for each
contact. Its facets are planes spanned by pairs of segments, so that the smallest friction
coefficient and the distance from opening follow without iteration. Moments are divided by the arm
d/2 of friction at the object's surface, so that all three components are forces.
"""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.program import installed_solvers
import numpy as np
from numpy.typing import NDArray
import qpsolvers

Array = NDArray[np.float64]

#: Closed when what is left is this small, against the forces involved.
CLOSURE_TOLERANCE = 1e-6
#: Facets whose normal is this short, against 1, are degenerate: their segments are parallel.
FACET_TOLERANCE = 1e-9
#: Weight of small friction forces against a small residual.
REGULARIZATION = 1e-9


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


def close(tangents: Array, normal_forces: Array, load: Array, friction: float) -> Closure:
    """
    Balance a load by friction forces with |F_i| <= mu N_i.

    :param tangents: (k, 2) unit tangents of the object at the contacts, counter-clockwise.
    :param normal_forces: (k,) N_i, not negative [N].
    :param load: (3,) resultant of all else on the object: fx, fy, m / (d/2) [N].
    :param friction: mu, not negative.
    """
    touching = normal_forces > 0.0
    segments = np.column_stack([tangents[touching], np.ones(touching.sum())])
    segments = segments * normal_forces[touching, None]
    tolerance = CLOSURE_TOLERANCE * max(
        1e-3, float(np.abs(load).max()), float(normal_forces.sum())
    )
    required, margin = _extremes(segments, -load, friction, tolerance)
    forces = np.zeros(len(normal_forces))
    shares = _balance(segments, load, friction)
    forces[touching] = shares * normal_forces[touching]
    residual = float(np.linalg.norm(segments.T @ shares + load))
    return Closure(residual <= tolerance, residual, tolerance, forces, required, margin)


def _balance(segments: Array, load: Array, friction: float) -> Array:
    """Return the shares (k,) in [-mu, mu] of the segments that balance the load best."""
    k = len(segments)
    if k == 0 or friction == 0.0:
        return np.zeros(k)
    size = np.linalg.norm(segments, axis=1).max()
    scaled = segments / size
    bound = np.full(k, friction)
    for solver in installed_solvers():
        shares = qpsolvers.solve_qp(
            scaled @ scaled.T + REGULARIZATION * np.eye(k),
            scaled @ load / size,
            lb=-bound,
            ub=bound,
            solver=solver,
        )
        if shares is not None:
            return np.clip(shares, -bound, bound)
    raise SolverError('the friction problem was not solved by any of the installed solvers')


def _extremes(
    segments: Array, wanted: Array, friction: float, tolerance: float
) -> tuple[float, float]:
    """
    Return the smallest coefficient with which friction gives a wrench, and how far it is inside.

    :param segments: (k, 3), of friction at coefficient 1.
    """
    if np.linalg.norm(wanted) <= tolerance and len(segments) == 0:
        return 0.0, 0.0
    first, second = np.triu_indices(len(segments), 1)
    normals = np.cross(segments[first], segments[second])
    sizes = np.linalg.norm(normals, axis=1)
    reach = np.linalg.norm(segments, axis=1)
    good = sizes > FACET_TOLERANCE * reach[first] * reach[second]
    if not good.any():
        return (0.0 if np.linalg.norm(wanted) <= tolerance else np.inf), 0.0
    normals = normals[good] / sizes[good, None]
    support = np.abs(normals @ segments.T).sum(axis=1)
    need = np.abs(normals @ wanted)
    # A flat zonotope, as of two contacts, reaches nothing across its plane.
    flat = support <= FACET_TOLERANCE * reach.sum()
    if (need[flat] > tolerance).any():
        return np.inf, -float(need[flat].max())
    full = ~flat
    required = float((need[full] / support[full]).max(initial=0.0))
    margin = 0.0 if flat.any() else float((friction * support - need).min())
    return required, margin
