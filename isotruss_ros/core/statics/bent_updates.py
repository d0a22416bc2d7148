# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Bent tubes linearised again about a predicted state, and conversion of their state.

Tubes that loads begin to deform become deformable. Samples whose members are then divided alike
stay together.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from isotruss_ros.core.numerics.arrays import Array, Flags, Indices
from isotruss_ros.core.numerics.samples import apply, first_sample, pick, take
from isotruss_ros.core.statics.bent_tubes import BentState, BentTubes, Prediction
from isotruss_ros.core.statics.blocks import Layout
from isotruss_ros.core.statics.frame import Frame, largest_motion
from isotruss_ros.core.statics.load_points import (
    are_at_rings,
    Cuts,
    group_samples,
    Lines,
)
from isotruss_ros.core.statics.structure import Structure
from isotruss_ros.core.statics.tangent import linearize
import numpy as np

#: Largest force on a hinge of a tube that is kept undeformed [N]; it displaces nodes by about
#: `SETTLED_MOTION`, and rounding errors are below 1e-10. It grows by 1e5 N/m^2 times the square of
#: the motion of nodes, as the forces that a linearisation leaves. With a thirtieth of this growth,
#: the tubes of nine_member are deformed in every grasp; with a tenth of it, in some.
KEPT_FORCE = 1e-8


def update_tubes(
    bent: BentTubes, loads: Array, positions: Array, structure: Structure | None = None
) -> BentTubes:
    """Return the tubes linearised about the state that these predict under loads."""
    predicted = bent.predict(loads, positions)
    if structure is None or structure.key == bent.structure.key:
        ((_, updated),) = update_samples(bent, predicted)
        return updated
    # Finding the unloaded blocks of another structure would take longer.
    every = structure.frame.layout.active
    cuts = Cuts.of(structure, bent.members, positions)
    predicted = predicted._replace(cuts=cuts, factors=bent.factors(loads, cuts.places))
    relative, absolute = bent.displace(predicted.factors)
    predicted = predicted._replace(relative=relative, absolute=absolute)
    return _relinearize(*_move_tubes(bent, predicted), positions, cuts, every, structure)


def update_samples(
    bent: BentTubes, predicted: Prediction, chosen: Flags | None = None
) -> Iterator[tuple[Indices | None, BentTubes]]:
    """
    Yield the tubes of chosen samples, or of all, linearised about predicted states.

    They are the indices (q,) of samples, see `group_samples`, and their tubes with one layout, for
    each layout.
    """
    values = *_move_tubes(bent, predicted), predicted.positions, predicted.cuts
    every = *values, _find_loaded(bent, predicted)
    for indices in group_samples(bent.structure, predicted.cuts, chosen):
        moved, near, positions, cuts, loaded = every if indices is None else take(every, indices)
        active = _active(bent.frame.layout, loaded)
        yield indices, _relinearize(moved, near, positions, cuts, active, moved.structure)


def group_key(bent: BentTubes) -> tuple[object, ...]:
    """Return a hashable value that is equal for samples that can be joined."""
    at_rings = first_sample(are_at_rings(bent.structure, bent.cuts))
    return *bent.frame.layout.key, at_rings.tobytes()


def _move_tubes(bent: BentTubes, predicted: Prediction) -> tuple[BentTubes, Flags]:
    """Return the tubes in a predicted state, without results; and whether nodes are near cuts."""
    near = _are_near(bent, predicted.cuts)
    if not near.all():  # nodes that are not near do not move to the cuts
        places = np.where(near[..., None], predicted.cuts.places, bent.cuts.places)
        factors = bent.factors(predicted.loads, places)
        relative, absolute = bent.displace(factors)
        predicted = predicted._replace(factors=factors, relative=relative, absolute=absolute)
    fields = bent.structure, bent.members, bent.places, bent.cuts, bent.lines, bent.frame
    moved = BentTubes(*fields, _predict_state(bent, predicted))
    moved.__dict__['kept'] = bent.kept
    return moved, near


def _relinearize(
    bent: BentTubes,
    near: Flags,
    positions: Array,
    cuts: Cuts,
    active: Indices,
    structure: Structure,
) -> BentTubes:
    """Return the tubes with cuts in one layout, see `_move_tubes`."""
    frame, state = structure.frame.cut(first_sample(cuts.pieces), cuts.within, active), bent.state
    if not near.all() or frame.layout.key != bent.frame.layout.key:
        state = _convert(bent, frame, near)
    lines = bent.lines
    if structure is not bent.structure:
        lines = Lines.of(structure, bent.members)
    updated = BentTubes(structure, bent.members, positions, cuts, lines, frame, state)
    if structure is bent.structure and frame.layout is bent.frame.layout:
        updated.__dict__['kept'] = bent.kept
    return updated


def _are_near(bent: BentTubes, cuts: Cuts) -> Flags:
    """Return whether no node moves to its cut by more than half of a part beside it."""
    # Farther nodes are interpolated on the bent member, because the error of an extrapolation
    # would turn the part.
    shorter = bent.shorter_parts
    return (np.abs(cuts.places - bent.cuts.places) <= 0.5 * shorter).all(axis=-1)


def _predict_state(bent: BentTubes, predicted: Prediction) -> BentState:
    """Return a predicted state."""
    force_changes, _ = bent.force_changes(predicted.factors, predicted.absolute)
    axial = bent.tangent.forces.values[..., 0] + force_changes[..., 0]
    return BentState(bent.state.unknowns + predicted.relative, predicted.loads, axial)


def _find_loaded(bent: BentTubes, predicted: Prediction) -> Flags:
    """Return which of the kept blocks (..., b) loads deform, see `UnloadedBlocks`."""
    changes = predicted.absolute
    if not bent.frame.layout.kept:
        return np.zeros((*changes.shape[:-1], 0), dtype=bool)
    motion = largest_motion(bent.frame.displacements(changes))
    bound = KEPT_FORCE * (1.0 + 1e13 * motion**2)
    are_loaded = []
    for blocks, forces, stiffness in zip(*bent.tangent.kept, strict=True):
        hinge_forces = forces + apply(stiffness, changes[..., blocks.outer])
        are_loaded.append(np.abs(hinge_forces).max(axis=-1) > bound[..., None])
    return np.concatenate(are_loaded, axis=-1)


def _active(layout: Layout, loaded: Flags) -> Indices:
    """Return the active blocks of a layout, and the kept blocks (..., b) that loads deform."""
    if not loaded.any():
        return layout.active
    in_any_sample = loaded.reshape(-1, len(layout.kept_ids)).any(axis=0)
    return np.sort(np.append(layout.active, layout.kept_ids[in_any_sample]))


def _convert(bent: BentTubes, frame: Frame, near: Flags) -> BentState:
    """Return the state of a similar frame; `near`: samples whose cuts are displaced as these."""
    state, layout = bent.state, frame.layout
    unknowns = bent.complete(state.unknowns)
    # Begins and middles of its parts, as positions in the members of this frame.
    length_ratios = (bent.structure.frame.length / frame.uncut.length)[..., layout.whole]
    begins = length_ratios * frame.begins
    middles = length_ratios * (frame.begins + 0.5 * frame.length)
    if not near.all():
        nodes, behind = bent.frame.displacements(unknowns), layout.behind
        at_cuts = bent.frame.interpolate(nodes, layout.whole[behind], begins[..., behind])
        last_nodes = slice(-len(behind), None)
        nodes[..., last_nodes, :] = np.where(
            near[..., None, None], nodes[..., last_nodes, :], at_cuts
        )
    part = bent.frame.locate(layout.whole, middles)
    # Tubes without parts in this frame are undeformed.
    axial = np.where(part < 0, 0.0, pick(state.axial, part))
    return BentState(unknowns, state.loads, axial)


def activate_tubes(bent: BentTubes) -> BentTubes:
    """Return these tubes with the tubes that carry no loads deformable, too."""
    if not bent.frame.layout.kept:
        return bent
    frame = bent.structure.frame.cut(first_sample(bent.cuts.pieces), bent.cuts.within)
    state = _convert(bent, frame, np.True_)
    tangent = linearize(frame, state.unknowns, state.axial)
    axial = tangent.forces.values[..., 0]
    return replace(bent, frame=frame, state=state._replace(axial=axial))


def describe_state(bent: BentTubes, loads: Array, positions: Array) -> tuple[Array, Array]:
    """Return `values` of the state that these predict under loads, and `at_points` there."""
    predicted, at_points = bent.predict(loads, positions), bent.at_points.copy()
    at_points[..., -1] = bent.respond(loads, predicted.cuts.places)
    if not _are_near(bent, predicted.cuts):
        return _join_state(update_tubes(bent, loads, positions)), at_points
    return _join_state(replace(bent, state=_predict_state(bent, predicted))), at_points


def _join_state(bent: BentTubes) -> Array:
    """Return the linearised state as a vector, see `of`, with all blocks deformable."""
    return np.concatenate([part.ravel() for part in activate_tubes(bent).state])
