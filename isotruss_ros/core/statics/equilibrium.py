# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Equilibria of a frame under loads on its nodes.

`solve` is linear about the unloaded frame, as in the paper. `bend` finds the equilibrium of the
bent frame by Newton's method; its first step is `solve`. `follow_loads` increases the loads up to
the limit load, at which the stiffness is singular; at larger loads there is no stable equilibrium
nearby. Newton's method may still converge to an unstable equilibrium, which negative pivots of the
factorised stiffness indicate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.samples import take
from isotruss_ros.core.numerics.tolerances import COINCIDENCE, MAX_CONDITION, MAX_NEWTON_ITERATIONS
from isotruss_ros.core.statics.beam_column import end_forces
from isotruss_ros.core.statics.blocks import Condensed
from isotruss_ros.core.statics.frame import Frame, largest_motion
from isotruss_ros.core.statics.tangent import linearize, Tangent, TUBE_CURVATURE
import numpy as np

#: Largest admissible ratio of the displacements to those of the linear prediction [-].
MAX_GROWTH = 1.5
#: Largest displacement of a node in a load step, by linear prediction [m].
MAX_DISPLACEMENT_STEP = 0.01
#: Relative tolerance of a limit load [-].
LIMIT_TOLERANCE = 1e-3


@dataclass(frozen=True, eq=False)
class FrameState:
    """Displacements, reactions and member forces of a frame under loads."""

    #: (n, 3) displacements ux, uy [m], theta [rad]; theta is zero at nodes at which all members
    #: are pinned
    displacements: Array
    #: (n, 3) forces fx, fy [N] and moments m [N m] of the supports on the frame; zero at nodes
    #: without support
    reactions: Array
    #: (p, 6) forces of the nodes on the parts; at the start and then at the end, the force along
    #: the chord and across it [N] and the moment [N m]
    end_forces: Array
    #: (p,) axial forces that amplify moments inside parts [N]; zero in the linear model
    bowing: Array


def unloaded(frame: Frame) -> Tangent:
    """Return a frame linearised without loads; raise StructureError if it is a mechanism."""
    tangent = linearize(frame, np.zeros(len(frame.scale)))
    solve_unloaded(tangent, np.zeros((3 * len(frame.points), 0)))
    return tangent


def solve_unloaded(tangent: Tangent, loads: Array) -> tuple[Condensed, Array]:
    """
    Return the condensed matrix and the linear responses of a frame linearised without loads.

    The responses (..., u, p) are the unknowns by loads (3 n, p) on the nodes. Raise StructureError
    if the frame is a mechanism; its message is that of the first sample.
    """
    frame = tangent.frame
    rows, columns = frame.layout.numbering.rows, loads.shape[1]
    right = np.zeros((*frame.scale.shape, columns + 1))
    right[..., rows:, :columns] = loads
    # The response to an irregular load is a lower bound of the condition number.
    right[..., columns] = irregular_loads(frame)
    try:
        condensed, solution = tangent.solve(right)
        condition = np.abs(solution[..., columns] / frame.scale).max()
    except StructureError:
        condition = np.inf
    if condition < MAX_CONDITION:  # the stiffness matrix (4) is regular
        return condensed, solution[..., :columns]
    if frame.scale.ndim > 1:  # one by one
        for i in range(len(frame.scale)):
            solve_unloaded(take(tangent, i), loads)
    raise StructureError(
        f'the structure is a mechanism: {", ".join(_find_loose_nodes(tangent))} can move '
        'without resistance; support it or connect it'
    )


def irregular_loads(frame: Frame) -> Array:
    """Return loads (..., u) whose scaled response is a lower bound of the condition number."""
    return np.cos(np.arange(frame.scale.shape[-1]) ** 2) / frame.scale


def _find_loose_nodes(tangent: Tangent) -> list[str]:
    """Return the names of the nodes that can move without force in a singular frame."""
    frame, numbering = tangent.frame, tangent.frame.layout.numbering
    matrix, free = np.zeros((len(frame.scale),) * 2), numbering.free
    for group, blocks in zip(frame.layout.groups, tangent.assembled.matrices, strict=True):
        for indices, block in zip(np.hstack([group.outer, group.inner]), blocks, strict=True):
            matrix[np.ix_(indices, indices)] += block
    eigenvalues, modes = np.linalg.eigh(matrix[np.ix_(free, free)])
    is_loose = np.abs(eigenvalues) < np.abs(eigenvalues).max() / MAX_CONDITION**0.5
    is_loose[np.abs(eigenvalues).argmin()] = True
    motions = np.zeros(len(free))
    motions[free] = np.abs(frame.scale[free, None] * modes[:, is_loose]).max(axis=1)
    of_nodes = frame.displacements(motions).max(axis=1)
    return [numbering.names[i] for i in np.flatnonzero(of_nodes > 1e-3 * of_nodes.max())]


def solve(tangent: Tangent, loads: Array) -> FrameState:
    """Return displacements, reactions and member forces under loads (n, 3) by linear (4)."""
    frame, layout = tangent.frame, tangent.frame.layout
    changes = tangent.respond(loads.reshape(-1, 1))
    displacements = frame.motions(changes)
    forces, _ = tangent.force_changes(displacements)
    carried = tangent.sum_forces(np.arange(len(frame.length)), forces)[:, 0]
    multipliers = changes[: layout.numbering.rows, 0]
    slopes = layout.numbering.constraints.slopes(frame.points, layout.rows)
    row_forces = slopes * multipliers[layout.rows, None]
    carried += np.bincount(layout.row_places[:, 1:].ravel(), row_forces.ravel(), len(carried))
    return FrameState(
        displacements[..., 0],
        _reactions(frame, frame.displacements(carried) - loads),
        end_forces(forces[..., 0], tangent.length),
        np.zeros(len(frame.length)),
    )


@np.errstate(over='ignore', invalid='ignore', divide='ignore')
def bend(start: Tangent, loads: Array) -> Tangent | None:
    """Return the bent frame in equilibrium under loads (n, 3), found by Newton's method."""
    tangent, frame, predicted = start, start.frame, np.inf
    applied = np.append(np.zeros(frame.layout.numbering.rows), loads)
    for count in range(MAX_NEWTON_ITERATIONS):
        _, step = tangent.solve((applied - tangent.assembled.carried)[:, None])
        moved = frame.motions(step)
        largest = largest_motion(moved[..., 0])
        from_start = tangent.displacements + moved[..., 0] - start.displacements
        if count == 0:
            predicted = largest
        # An equilibrium far beyond the linear prediction is on another branch.
        elif not largest_motion(from_start) <= MAX_GROWTH * predicted:
            return None
        force_changes, _ = tangent.force_changes(moved)
        axial = tangent.forces.values[:, 0] + force_changes[:, 0, 0]
        tangent = linearize(frame, tangent.unknowns + step[:, 0], axial)
        if TUBE_CURVATURE * largest**2 <= COINCIDENCE:
            return tangent
    return None


def state_under(tangent: Tangent, loads: Array) -> FrameState:
    """Return displacements, reactions and member forces of a bent frame."""
    carried = tangent.frame.displacements(tangent.assembled.carried)
    return FrameState(
        tangent.displacements,
        _reactions(tangent.frame, carried - loads),
        end_forces(tangent.forces.values, tangent.length),
        tangent.forces.values[:, 0],
    )


def _reactions(frame: Frame, missing: Array) -> Array:
    """Return the support reactions (n, 3) from the residual (n, 3) of the balance."""
    reactions, held = np.zeros((len(frame.points), 3)), frame.layout.numbering.held
    reactions[: len(held)] = missing[: len(held)] * held
    return reactions


class LoadPath(NamedTuple):
    """Stable equilibria of a frame under increasing loads."""

    factors: list[float]  #: (s,) factors on the loads, increasing from 0
    tangents: list[Tangent]  #: (s,) frames linearised about the equilibria at these factors
    limit: float  #: factor of the limit load; infinite if the path ends before it


def follow_loads(
    start: Tangent, loads: Array, last_factor: float, farthest: float = np.inf
) -> LoadPath:
    """Follow loads (n, 3) from zero to a last factor, or to displacements of `farthest` [m]."""
    path = LoadPath([0.0], [start], np.inf)
    step = last_factor
    for _ in range(400):
        factor, tangent = path.factors[-1], path.tangents[-1]
        if factor >= last_factor or largest_motion(tangent.displacements) > farthest:
            return path
        moved = start.frame.motions(tangent.respond(loads.reshape(-1, 1)))
        motion = float(largest_motion(moved[..., 0]))
        bounded_step = MAX_DISPLACEMENT_STEP / motion if motion > 0.0 else np.inf
        step = min(2.0 * step, bounded_step, last_factor - factor)
        bent = bend(tangent, (factor + step) * loads)
        while bent is None or not bent.is_stable:
            if step <= LIMIT_TOLERANCE * factor:
                return path._replace(limit=factor + step)
            step *= 0.5
            bent = bend(tangent, (factor + step) * loads)
        path.factors.append(factor + step)
        path.tangents.append(bent)
    return path
