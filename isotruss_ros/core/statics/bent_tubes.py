# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Tubes with k load points, linearised about a bent state, and their linear prediction.

Tubes without loads are kept undeformed, see `UnloadedBlocks`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.samples import apply, first_sample
from isotruss_ros.core.statics.beam_column import end_forces
from isotruss_ros.core.statics.frame import Frame, largest_motion
from isotruss_ros.core.statics.load_points import Cuts, Lines
from isotruss_ros.core.statics.load_responses import find_responses, LoadResponses
from isotruss_ros.core.statics.structure import Structure
from isotruss_ros.core.statics.tangent import linearize, Tangent
from isotruss_ros.core.statics.unloaded_blocks import UnloadedBlocks
import numpy as np

#: Tubes are linearised again if a node has moved farther than this from the linearised state [m]:
#: for a moving robot, and for a single equilibrium. The error of predicted displacements is
#: `TUBE_CURVATURE` times the square of the motion; the relative error of a stiffness is
#: `TUBE_CURVATURE` times the motion. With ten times the second value, stiffnesses have errors of
#: 4e-9 if a contact is 0.5 mm from a guide ring, so that their differences err by 2e-6.
FOLLOWED_MOTION, SETTLED_MOTION = 1e-4, 1e-11
#: The square of a load point's motion, divided by the length of the shorter part beside it and
#: multiplied by this length, counts as the square of a node's motion in `BentTubes.distance` [m].
PLACE_LENGTH = 0.02


class BentState(NamedTuple):
    """State of a bent frame about which tubes are linearised."""

    unknowns: Array  #: (u,) unknowns of the frame, see `Tangent`
    loads: Array  #: (k, 3) loads at the load points, see `BentTubes` [N, N m]
    axial: Array  #: (p,) axial forces of the frame's parts [N]


class Prediction(NamedTuple):
    """State of the tubes under loads at k load points, predicted by `LoadResponses`."""

    loads: Array  #: (k, 3) loads [N, N m]
    positions: Array  #: (k,) positions of the load points [m]
    cuts: Cuts  #: nodes at these positions
    factors: Array  #: (4k + 1,) factors of the responses
    relative: Array  #: (u,) changes of the unknowns relative to the moving load points
    absolute: Array  #: (u,) changes of the unknowns


@dataclass(frozen=True, eq=False)
class BentTubes:
    """
    Tubes of a robot with k load points, linearised about a bent state.

    A load is (f_along, f_across, m): forces along and across the straight member, and a moment [N,
    N m]. A response is the displacement along and across the straight member [m], and the
    inclination of the bent centre line [rad], see `InclinationWeights`.

    Of n samples with one layout, all arrays but `members` have the samples as their first axis.
    """

    shared: ClassVar[tuple[str, ...]] = ('members', 'length_by_motions')
    structure: Structure  #: structural model of the robot
    members: Indices  #: (k,) index of the member of each load point in `Robot.member_names`
    places: Array  #: (k,) distances of the load points from the members' starts [m]
    cuts: Cuts  #: nodes at the load points
    lines: Lines  #: members of the load points
    frame: Frame  #: the structure's frame with these nodes
    state: BentState  #: state about which the tubes are linearised
    #: (k, 3, 4k + 1) `at_points` from another process, if `state` is in equilibrium; else None
    received: Array | None = None

    @classmethod
    def of(
        cls,
        structure: Structure,
        members: Indices,
        positions: Array,
        values: Array | None = None,
        received: Array | None = None,
        deforms: bool = False,
    ) -> BentTubes:
        """
        Return the tubes linearised about the state `values`; None: without loads.

        Without loads, tubes without load points are kept undeformed unless `deforms` is true.
        """
        cuts = Cuts.of(structure, members, positions)
        if values is None:
            numbering, active = structure.frame.layout.numbering, None  # all blocks
            if not deforms:
                active = np.union1d(numbering.owner[first_sample(cuts.pieces)], numbering.hinged)
            return cls.straight(structure, members, positions, cuts, active)
        frame = structure.frame.cut(cuts.pieces, cuts.within)
        sizes = len(frame.layout.scaled_as), 3 * len(members), len(frame.length)
        loads_begin, axial_begin, size = np.cumsum(sizes)
        if values.shape != (size,):
            raise StructureError(f'bent tubes with {values.size} values: must be {size}')
        unknowns, loads, axial = np.split(values, [loads_begin, axial_begin])
        state = BentState(unknowns, loads.reshape(-1, 3), axial)
        lines = Lines.of(structure, members)
        return cls(structure, members, positions, cuts, lines, frame, state, received)

    @classmethod
    def straight(
        cls,
        structure: Structure,
        members: Indices,
        positions: Array,
        cuts: Cuts,
        active: Indices | None,
    ) -> BentTubes:
        """Return the tubes without loads, of which the blocks `active` deform; None: all."""
        frame, lead = (
            structure.frame.cut(first_sample(cuts.pieces), cuts.within, active),
            positions.shape,
        )
        state = BentState(
            np.zeros(frame.scale.shape), np.zeros((*lead, 3)), np.zeros(frame.length.shape)
        )
        lines = Lines.of(structure, members)
        return cls(structure, members, positions, cuts, lines, frame, state)

    @cached_property
    def length_by_motions(self) -> Array:
        """Return the changes (p, k) of the parts' lengths by unit motions of the load points."""
        return self.frame.layout.length_by_motions * first_sample(self.cuts.directions)

    @property
    def shorter_parts(self) -> Array:
        """Return the lengths (k,) of the shorter parts beside the load points [m]."""
        length, layout = self.frame.length, self.frame.layout
        return np.minimum(length.take(layout.before, axis=-1), length.take(layout.behind, axis=-1))

    @cached_property
    def kept(self) -> list[UnloadedBlocks]:
        """Return the tubes that are kept undeformed."""
        groups = self.structure.blocks if self.frame.layout.kept else []
        return [groups[group].chosen(blocks) for group, blocks in self.frame.layout.kept]

    @cached_property
    def tangent(self) -> Tangent:
        """Return the frame linearised about `state`."""
        return linearize(self.frame, self.state.unknowns, self.state.axial, self.kept)

    @cached_property
    def responses(self) -> LoadResponses:
        """Return the responses to loads and to motions of the load points."""
        turns, loads = self.lines.turns, self.state.loads
        return find_responses(self.structure, self.tangent, turns, loads, self.length_by_motions)

    @property
    def at_points(self) -> Array:
        """Return the responses at the load points, see `LoadResponses`."""
        return self.responses.at_points if self.received is None else self.received

    @property
    def motion_columns(self) -> slice:
        """Return the columns of `LoadResponses` for unit motions of the load points."""
        return slice(3 * len(self.members), 4 * len(self.members))

    def respond(self, loads: Array, positions: Array) -> Array:
        """Return displacements and inclinations (k, 3) by loads (k, 3) at positions (k,)."""
        factors = self.factors(loads, positions)
        return apply(self.at_points, factors[..., None, :])

    def predict(self, loads: Array, positions: Array) -> Prediction:
        """Return the linear prediction of the state under loads (k, 3) at positions (k,)."""
        cuts = Cuts.of(self.structure, self.members, positions)
        factors = self.factors(loads, cuts.places)
        return Prediction(loads, positions, cuts, factors, *self.displace(factors))

    def distance(self, predicted: Prediction) -> Array:
        """Return the largest motion of a node to a predicted state [m]."""
        largest = largest_motion(self.frame.displacements(predicted.relative))
        factors = predicted.factors[..., self.motion_columns]
        weighted = np.abs(factors) * np.sqrt(PLACE_LENGTH / self.shorter_parts)
        return np.maximum(largest, weighted.max(axis=-1))

    def displace(self, factors: Array) -> tuple[Array, Array]:
        """Return the unknowns' changes (u,) relative to the moving load points, and absolute."""
        if self.received is not None and not factors[:-1].any():  # in the state itself
            absolute = np.zeros(self.state.unknowns.shape)
        else:
            absolute = apply(self.responses.unknowns, factors)
        relative = absolute.copy()
        # The displacement is relative to the place, which moves along its member.
        motions = self.lines.axis * factors[..., self.motion_columns]
        last_nodes = slice(-len(self.members), None)
        at_points = self.frame.displacements(relative)[..., last_nodes, :]
        at_points[..., 0] -= motions.real
        at_points[..., 1] -= motions.imag
        return relative, absolute

    def factors(self, loads: Array, positions: Array) -> Array:
        """Return the weights (4k + 1,) of the columns of `LoadResponses` by loads at positions."""
        added_loads, motions = _flat(loads - self.state.loads), positions - self.cuts.places
        return np.concatenate([added_loads, motions, np.ones((*motions.shape[:-1], 1))], axis=-1)

    def complete(self, unknowns: Array) -> Array:
        """Return unknowns (u,) with those of undeformed tubes, which turn with their hinges."""
        completed = unknowns.copy()
        for blocks in self.kept:
            blocks.complete(completed)
        return completed

    def displacements(self, loads: Array, positions: Array) -> Array:
        """Return the linear prediction of the nodes' displacements, (n, 3) [m, rad]."""
        relative, _ = self.displace(self.factors(loads, positions))
        return self.frame.displacements(self.complete(self.state.unknowns + relative))

    def end_forces(self, loads: Array, positions: Array) -> tuple[Array, Array]:
        """Return linear predictions of end forces (p, 6), and of unscaled axial forces (p,)."""
        tangent, factors = self.tangent, self.factors(loads, positions)
        _, absolute = self.displace(factors)
        force_changes, chord_changes = self.force_changes(factors, absolute)
        forces = tangent.forces.values + force_changes
        ends = end_forces(forces, tangent.length + chord_changes)
        return ends, forces[..., 0]

    def force_changes(self, factors: Array, unknowns: Array) -> tuple[Array, Array]:
        """Return changes of end forces (p, 3) and elongations (p,) since the linearisation."""
        moved = self.frame.displacements(unknowns)[..., None]
        by_nodes, chords = self.tangent.force_changes(moved)
        lengths = apply(self.length_by_motions, factors[..., self.motion_columns])
        return by_nodes[..., 0] + self.tangent.length_rates * lengths[..., None], chords[..., 0]


def _flat(loads: Array) -> Array:
    """Return loads (..., k, 3) as vectors (..., 3k)."""
    return loads.reshape(*loads.shape[:-2], -1)
