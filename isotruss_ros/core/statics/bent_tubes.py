# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Compliance of the tubes at k load points, linearised about a bent state.

Each load point is a node that divides its member into parts; its place is its distance from the
start of the member. If it moves along the member, the part before it becomes longer and the part
behind it shorter. Tubes without loads are kept undeformed, see `UnloadedBlocks`.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.numerics.samples import pick, take
from isotruss_ros.core.numerics.tolerances import MAX_CONDITION
from isotruss_ros.core.statics.beam_column import end_forces
from isotruss_ros.core.statics.blocks import Layout
from isotruss_ros.core.statics.equilibrium import irregular_loads
from isotruss_ros.core.statics.frame import Frame, keep_apart, largest_motion
from isotruss_ros.core.statics.inclinations import InclinationWeights, RING_HALF_WIDTH
from isotruss_ros.core.statics.structure import Structure
from isotruss_ros.core.statics.tangent import linearize, Slopes, Tangent
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
#: Largest force on a hinge of a tube that is kept undeformed [N]; it displaces nodes by about
#: `SETTLED_MOTION`, and rounding errors are below 1e-10. It grows by 1e5 N/m^2 times the square of
#: the motion of nodes, as the forces that a linearisation leaves. With a thirtieth of this growth,
#: the tubes of nine_member are deformed in every grasp; with a tenth of it, in some.
KEPT_FORCE = 1e-8


class BentState(NamedTuple):
    """State of a bent frame about which tubes are linearised."""

    unknowns: Array  #: (u,) unknowns of the frame, see `Tangent`
    loads: Array  #: (k, 3) loads at the load points, see `BentTubes` [N, N m]
    axial: Array  #: (p,) axial forces of the frame's parts [N]


class LoadResponses(NamedTuple):
    """
    Changes of bent tubes by unit loads and by unit motions of k load points along their members.

    The columns are 3k loads, k motions, and a last one for the loads that the linearised state
    lacks for equilibrium.
    """

    unknowns: Array  #: (u, 4k + 1) changes of the frame's unknowns
    #: (k, 3, 4k + 1) changes of the responses, see `BentTubes`; the last column is their value
    at_points: Array


class Prediction(NamedTuple):
    """State of the tubes under loads at k load points, predicted by `LoadResponses`."""

    loads: Array  #: (k, 3) loads [N, N m]
    positions: Array  #: (k,) positions of the load points [m]
    cuts: Cuts  #: nodes at these positions
    factors: Array  #: (4k + 1,) factors of the responses
    relative: Array  #: (u,) changes of the unknowns relative to the moving load points
    absolute: Array  #: (u,) changes of the unknowns


class Compliance(NamedTuple):
    """Responses (k, 3) at the load points as a linear function of loads and places."""

    matrix: Array  #: (k, 3, k, 3) responses to unit loads
    rates: Array  #: (k, 3, k) derivatives by the places [-, -, rad/m]
    constant: Array  #: (k, 3) responses, extrapolated to zero loads and zero places


class TubeRates(NamedTuple):
    """Derivatives of the tubes' displacements and forces with respect to p parameters."""

    nodes: Array  #: (n, 3, p) of the displacements of the frame's nodes [m, rad]
    inclinations: Array  #: (k, p) of the bent centre lines at the load points [rad]
    forces: Array  #: (c, 3, p) of the `EndForces` of the frame's parts with fixed nodes


class Lines(NamedTuple):
    """Members of k load points: start x + iy [m], unit vector to the end x + iy, length [m]."""

    start: Points
    axis: Points
    length: Array
    turns: Array  #: (k, 3, 3) unit loads and displacements of the member's axes as (fx, fy, m)

    @classmethod
    def of(cls, structure: Structure, members: Indices) -> Lines:
        """Return the members with given indices (k,), from pinch point to pinch point."""
        config, topology = structure.config, structure.config.robot.topology
        start, axis = config.points[..., topology.b[members]], config.member_axes[..., members]
        turns = np.zeros((*axis.shape, 3, 3))
        turns[..., 0, 0] = turns[..., 1, 1] = axis.real
        turns[..., 1, 0], turns[..., 0, 1], turns[..., 2, 2] = axis.imag, -axis.imag, 1.0
        return cls(start, axis, config.member_lengths[..., members], turns)


class Cuts(NamedTuple):
    """Nodes of a frame at k load points, no two of them nearer than the shortest part."""

    pieces: Indices  #: (k,) members of the frame that the nodes divide
    within: Array  #: (k,) distances of the nodes from the starts of these members [m]
    directions: Array  #: (k,) 1 for a piece that runs along its member of the robot, else -1
    places: Array  #: (k,) distances of the nodes from the starts of the robot's members [m]

    @classmethod
    def of(cls, structure: Structure, members: Indices, positions: Array) -> Cuts:
        """Return the nodes at positions (k,) on members (k,) of the robot."""
        pieces, within, directions = structure.locate(members, positions)
        lengths = pick(structure.frame.length, pieces)
        inside = keep_apart(pieces, within, lengths)
        return cls(pieces, inside, directions, positions + directions * (inside - within))


@dataclass(frozen=True, eq=False)
class BentTubes:
    """
    Tubes of a robot with k load points, linearised about a bent state.

    A load is (f_along, f_across, m): forces along and across the straight member, and a moment [N,
    N m]. A response is the displacement along and across the straight member [m], and the
    inclination of the bent centre line [rad], see `InclinationWeights`.

    Of n samples with one layout, all arrays but `members` have the samples as their first axis.
    """

    shared: ClassVar[tuple[str, ...]] = ('members', '_length_by_motions')
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
                active = np.union1d(numbering.owner[_first(cuts.pieces)], numbering.hinged)
            return cls.straight(structure, members, positions, cuts, active)
        frame = structure.frame.cut(cuts.pieces, cuts.within)
        sizes = len(frame.scale), 3 * len(members), len(frame.length)
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
            structure.frame.cut(_first(cuts.pieces), cuts.within, active),
            positions.shape,
        )
        state = BentState(
            np.zeros(frame.scale.shape), np.zeros((*lead, 3)), np.zeros(frame.length.shape)
        )
        lines = Lines.of(structure, members)
        return cls(structure, members, positions, cuts, lines, frame, state)

    @property
    def values(self) -> Array:
        """Return the linearised state as a vector, see `of`, with all blocks deformable."""
        return np.concatenate([part.ravel() for part in self.activated().state])

    def activated(self) -> BentTubes:
        """Return these tubes with the tubes that carry no loads deformable, too."""
        if not self.frame.layout.kept:
            return self
        frame = self.structure.frame.cut(_first(self.cuts.pieces), self.cuts.within)
        state = self._convert(self.state, frame, True)
        tangent = linearize(frame, state.unknowns, state.axial)
        axial = tangent.forces.values[..., 0]
        return replace(self, frame=frame, state=state._replace(axial=axial))

    @cached_property
    def _length_by_motions(self) -> Array:
        """Return the changes (p, k) of the parts' lengths by unit motions of the load points."""
        return self.frame.layout.length_by_motions * _first(self.cuts.directions)

    @property
    def _shorter_parts(self) -> Array:
        """Return the lengths (k,) of the shorter parts beside the load points [m]."""
        length, layout = self.frame.length, self.frame.layout
        return np.minimum(length.take(layout.before, axis=-1), length.take(layout.behind, axis=-1))

    @cached_property
    def _kept(self) -> list[UnloadedBlocks]:
        """Return the tubes that are kept undeformed."""
        groups = self.structure.blocks if self.frame.layout.kept else []
        return [groups[group].chosen(blocks) for group, blocks in self.frame.layout.kept]

    @cached_property
    def tangent(self) -> Tangent:
        """Return the frame linearised about `state`."""
        return linearize(self.frame, self.state.unknowns, self.state.axial, self._kept)

    def _find_slopes(self) -> tuple[InclinationWeights, Slopes]:
        """Return the weights of the inclinations, and the inclinations that they weight."""
        ends = InclinationWeights.of(self.structure, self.frame)
        return ends, self.tangent.slopes(ends.parts, ends.signs)

    @cached_property
    def responses(self) -> LoadResponses:
        """Return the responses to loads and to motions of the load points."""
        tangent, layout = self.tangent, self.frame.layout
        (ends, slopes), count, motions = (
            self._find_slopes(),
            len(self.members),
            self._motion_columns,
        )
        loads = self._right_sides()
        # Straight tubes lack no loads for equilibrium, so the last column is free for a probe.
        is_probed = not layout.kept and not self.state.unknowns.any()
        if is_probed:
            loads[..., -1] = irregular_loads(self.frame)
        _, unknowns = tangent.solve(loads)
        if is_probed:
            condition = np.abs(unknowns[..., -1] / self.frame.scale).max()
            if not condition < MAX_CONDITION:
                _ = self.structure.unloaded  # raises an error that names the moving parts
            unknowns[..., -1] = 0.0
        # Displacements of the nodes in axes of the members, relative to their places, which move
        # along the members.
        to_member = self.lines.turns.swapaxes(-1, -2)
        node_rows, load_points = np.arange(-3 * count, 0).reshape(-1, 3), np.arange(count)
        at_points = to_member @ unknowns.take(node_rows, axis=-2)
        at_points[..., load_points, 0, motions.start + load_points] -= 1.0
        # The last column includes the responses in the linearised state.
        at_points[..., -1] += _apply(to_member, tangent.unknowns.take(node_rows, axis=-1))
        # Inclinations. The length of a part between two load points depends on both.
        at_ends = unknowns.take(layout.places[ends.parts], axis=-2)
        of_ends = (slopes.by_ends @ at_ends)[..., 0, :]
        rates = slopes.by_forces * tangent.length_rates.take(ends.parts, axis=-2)
        by_lengths = rates.sum(axis=-1)[..., None]
        of_ends[..., motions] += by_lengths * self._length_by_motions[ends.parts]
        of_ends[..., -1] += slopes.values
        at_points[..., 2, :] = ends.weights @ of_ends
        weight_rates = ends.by_length @ of_ends[..., -1, None]
        at_points[..., 2, motions] += weight_rates * self._length_by_motions[ends.between]
        return LoadResponses(unknowns, at_points)

    @property
    def at_points(self) -> Array:
        """Return the responses at the load points, see `LoadResponses`."""
        return self.responses.at_points if self.received is None else self.received

    @cached_property
    def compliance(self) -> Compliance:
        """Return the responses at the load points as a function of loads and places."""
        at_points, count = self.at_points, len(self.members)
        constant = self.respond(np.zeros(self.state.loads.shape), np.zeros(self.places.shape))
        matrix = at_points[..., : 3 * count].reshape(*at_points.shape[:-1], count, 3)
        return Compliance(matrix, at_points[..., self._motion_columns], constant)

    def _right_sides(self) -> Array:
        """Return the loads (u, 4k + 1) to which the columns of `LoadResponses` respond."""
        tangent, parts, count = self.tangent, self.frame.layout.parts, len(self.members)
        loads = np.zeros((*tangent.unknowns.shape, 4 * count + 1))
        # Unit loads on the nodes at the load points, which are the last ones; from member axes.
        node_rows = np.arange(-3 * count, 0).reshape(-1, 3)
        load_columns = np.arange(3 * count).reshape(count, 1, 3)
        loads[..., node_rows[:, :, None], load_columns] = self.lines.turns
        # Forces of lengthened parts.
        by_motions = self._length_by_motions[parts, None]
        forces = tangent.length_rates.take(parts, axis=-2)[..., None] * by_motions
        loads[..., self._motion_columns] = -tangent.sum_forces(parts, forces)
        # Loads without equilibrium in the linearised state.
        by_loads = loads[..., : 3 * count]
        loads[..., -1] = _apply(by_loads, _flat(self.state.loads)) - tangent.carried
        return loads

    @property
    def _motion_columns(self) -> slice:
        """Return the columns of `LoadResponses` for unit motions of the load points."""
        return slice(3 * len(self.members), 4 * len(self.members))

    def respond(self, loads: Array, positions: Array) -> Array:
        """Return displacements and inclinations (k, 3) by loads (k, 3) at positions (k,)."""
        factors = self._factors(loads, positions)
        return _apply(self.at_points, factors[..., None, :])

    def predict(self, loads: Array, positions: Array) -> Prediction:
        """Return the linear prediction of the state under loads (k, 3) at positions (k,)."""
        cuts = Cuts.of(self.structure, self.members, positions)
        factors = self._factors(loads, cuts.places)
        return Prediction(loads, positions, cuts, factors, *self._displace(factors))

    def distance(self, predicted: Prediction) -> Array:
        """Return the largest motion of a node to a predicted state [m]."""
        largest = largest_motion(self.frame.displacements(predicted.relative))
        factors = predicted.factors[..., self._motion_columns]
        weighted = np.abs(factors) * np.sqrt(PLACE_LENGTH / self._shorter_parts)
        return np.maximum(largest, weighted.max(axis=-1))

    def _displace(self, factors: Array) -> tuple[Array, Array]:
        """Return the unknowns' changes (u,) relative to the moving load points, and absolute."""
        if self.received is not None and not factors[:-1].any():  # in the state itself
            absolute = np.zeros(self.state.unknowns.shape)
        else:
            absolute = _apply(self.responses.unknowns, factors)
        relative = absolute.copy()
        # The displacement is relative to the place, which moves along its member.
        motions = self.lines.axis * factors[..., self._motion_columns]
        last_nodes = slice(-len(self.members), None)
        at_points = self.frame.displacements(relative)[..., last_nodes, :]
        at_points[..., 0] -= motions.real
        at_points[..., 1] -= motions.imag
        return relative, absolute

    def _factors(self, loads: Array, positions: Array) -> Array:
        """Return the factors (4k + 1,) of `LoadResponses`' columns for loads at positions (k,)."""
        added_loads, motions = _flat(loads - self.state.loads), positions - self.cuts.places
        return np.concatenate([added_loads, motions, np.ones((*motions.shape[:-1], 1))], axis=-1)

    def update(
        self, loads: Array, positions: Array, structure: Structure | None = None
    ) -> BentTubes:
        """Return the tubes linearised about the state that these predict under loads."""
        predicted = self.predict(loads, positions)
        active, is_near = self.frame.layout.active, bool(self._are_near(predicted.cuts))
        if structure is None or structure.key == self.structure.key:
            active = _active(self.frame.layout, self._find_loaded(predicted))
            return self._updated(predicted, active, is_near, self.structure)
        # Finding the unloaded blocks of another structure would take longer.
        every = structure.frame.layout.active
        cuts = Cuts.of(structure, self.members, positions)
        predicted = predicted._replace(cuts=cuts, factors=self._factors(loads, cuts.places))
        relative, absolute = self._displace(predicted.factors)
        predicted = predicted._replace(relative=relative, absolute=absolute)
        return self._updated(predicted, every, bool(self._are_near(cuts)), structure)

    def updates(self, predicted: Prediction) -> list[tuple[Indices, BentTubes]]:
        """
        Return the tubes of n samples, linearised about predicted states.

        :return: indices (q,) of samples, and their tubes with one layout, for each layout.
        """
        layout, cuts = self.frame.layout, predicted.cuts
        loaded, are_near = self._find_loaded(predicted), self._are_near(cuts)
        groups, updated = _group(self.structure, cuts, loaded, are_near), []
        for indices in groups:
            tubes, of_group = self, predicted
            if len(groups) > 1:
                tubes, of_group = take((self, predicted), indices)
            first = int(indices[0])
            active, is_near = _active(layout, loaded[first]), bool(are_near[first])
            updated.append((indices, tubes._updated(of_group, active, is_near, tubes.structure)))
        return updated

    @property
    def group_key(self) -> tuple[object, ...]:
        """Return a hashable value that is equal for samples that can be joined."""
        at_rings = _first(_are_at_rings(self.structure, self.cuts))
        return *self.frame.layout.key, at_rings.tobytes()

    def _updated(
        self, predicted: Prediction, active: Indices, is_near: bool, structure: Structure
    ) -> BentTubes:
        """Return the tubes with cuts in one layout; see `update`, `_find_loaded`, `_are_near`."""
        cuts = predicted.cuts
        frame = structure.frame.cut(_first(cuts.pieces), cuts.within, active)
        if not is_near:  # the nodes do not move to the cuts
            factors = self._factors(predicted.loads, self.cuts.places)
            relative, absolute = self._displace(factors)
            predicted = predicted._replace(factors=factors, relative=relative, absolute=absolute)
        state = self._predict(predicted)
        if not is_near or frame.layout.key != self.frame.layout.key:
            state = self._convert(state, frame, is_near)
        lines = self.lines
        if structure is not self.structure:
            lines = Lines.of(structure, self.members)
        positions = predicted.positions
        updated = BentTubes(structure, self.members, positions, cuts, lines, frame, state)
        if structure is self.structure and frame.layout is self.frame.layout:
            updated.__dict__['_kept'] = self._kept
        return updated

    def _are_near(self, cuts: Cuts) -> Flags:
        """Return whether no node moves to its cut by more than half of a part beside it."""
        # Farther nodes are interpolated on the bent member, because the error of an extrapolation
        # would turn the part.
        shorter = self._shorter_parts
        return (np.abs(cuts.places - self.cuts.places) <= 0.5 * shorter).all(axis=-1)

    def _predict(self, predicted: Prediction) -> BentState:
        """Return a predicted state."""
        force_changes, _ = self._force_changes(predicted.factors, predicted.absolute)
        axial = self.tangent.forces.values[..., 0] + force_changes[..., 0]
        return BentState(self.state.unknowns + predicted.relative, predicted.loads, axial)

    def describe(self, loads: Array, positions: Array) -> tuple[Array, Array]:
        """Return `values` of the state that these predict under loads, and `at_points` there."""
        predicted, at_points = self.predict(loads, positions), self.at_points.copy()
        at_points[..., -1] = self.respond(loads, predicted.cuts.places)
        if not self._are_near(predicted.cuts):
            return self.update(loads, positions).values, at_points
        return replace(self, state=self._predict(predicted)).values, at_points

    def _find_loaded(self, predicted: Prediction) -> Flags:
        """Return which of the kept blocks (..., b) loads deform, see `UnloadedBlocks`."""
        changes = predicted.absolute
        if not self.frame.layout.kept:
            return np.zeros((*changes.shape[:-1], 0), dtype=bool)
        motion = largest_motion(self.frame.displacements(changes))
        bound = KEPT_FORCE * (1.0 + 1e13 * motion**2)
        are_loaded = []
        for blocks, forces, stiffness in zip(*self.tangent.kept, strict=True):
            hinge_forces = forces + _apply(stiffness, changes[..., blocks.outer])
            are_loaded.append(np.abs(hinge_forces).max(axis=-1) > bound[..., None])
        return np.concatenate(are_loaded, axis=-1)

    def _convert(self, state: BentState, frame: Frame, is_near: bool) -> BentState:
        """Return the state of a similar frame; `is_near`: its cuts are displaced as these are."""
        unknowns, layout = self._complete(state.unknowns), frame.layout
        # Begins and middles of its parts, as positions in the members of this frame.
        length_ratios = (self.structure.frame.length / frame.uncut.length)[..., layout.whole]
        begins = length_ratios * frame.begins
        middles = length_ratios * (frame.begins + 0.5 * frame.length)
        if not is_near:
            nodes, behind = self.frame.displacements(unknowns), layout.behind
            at_cuts = self.frame.interpolate(nodes, layout.whole[behind], begins[..., behind])
            last_nodes = slice(-len(behind), None)
            self.frame.displacements(unknowns)[..., last_nodes, :] = at_cuts
        part = self.frame.locate(layout.whole, middles)
        # Tubes without parts in this frame are undeformed.
        axial = np.where(part < 0, 0.0, pick(state.axial, part))
        return BentState(unknowns, state.loads, axial)

    def _complete(self, unknowns: Array) -> Array:
        """Return unknowns (u,) with those of undeformed tubes, which turn with their hinges."""
        completed = unknowns.copy()
        for blocks in self._kept:
            blocks.complete(completed)
        return completed

    def load_changes(self, loads: Array, motions: Array) -> TubeRates:
        """Return the tubes' changes by p changes of loads (k, 3, p) and of positions (k, p)."""
        factors = np.concatenate([loads.reshape(-1, loads.shape[2]), motions])
        nodes = self.frame.motions(self.responses.unknowns[:, :-1] @ factors)
        inclinations = self.at_points[:, 2, :-1] @ factors
        lengths = (self._length_by_motions @ motions)[:, None]
        return TubeRates(nodes, inclinations, self.tangent.length_rates[..., None] * lengths)

    def displacements(self, loads: Array, positions: Array) -> Array:
        """Return the linear prediction of the nodes' displacements, (n, 3) [m, rad]."""
        relative, _ = self._displace(self._factors(loads, positions))
        return self.frame.displacements(self._complete(self.state.unknowns + relative))

    def end_forces(self, loads: Array, positions: Array) -> tuple[Array, Array]:
        """Return linear predictions of end forces (p, 6), and of unscaled axial forces (p,)."""
        tangent, factors = self.tangent, self._factors(loads, positions)
        _, absolute = self._displace(factors)
        force_changes, chord_changes = self._force_changes(factors, absolute)
        forces = tangent.forces.values + force_changes
        ends = end_forces(forces, tangent.length + chord_changes)
        return ends, forces[..., 0]

    def _force_changes(self, factors: Array, unknowns: Array) -> tuple[Array, Array]:
        """Return changes of end forces (p, 3) and elongations (p,) since the linearisation."""
        moved = self.frame.displacements(unknowns)[..., None]
        by_nodes, chords = self.tangent.force_changes(moved)
        lengths = _apply(self._length_by_motions, factors[..., self._motion_columns])
        return by_nodes[..., 0] + self.tangent.length_rates * lengths[..., None], chords[..., 0]

    def section_changes(self, changes: Array) -> TubeRates:
        """Return the tubes' changes by p changes of sections (4, c, p) of deformable blocks."""
        frame, tangent, (ends, slopes) = self.frame, self.tangent, self._find_slopes()
        # Forces of the changed parts between fixed nodes, then the unknowns in equilibrium.
        parts = np.flatnonzero(changes.any(axis=(0, 2)))
        forces = np.zeros((len(frame.length), 3, changes.shape[2]))
        forces[parts] = tangent.force_rates(parts) @ changes[:, parts].swapaxes(0, 1)
        _, unknowns = tangent.solve(-tangent.sum_forces(parts, forces[parts]))
        at_ends = unknowns[frame.layout.places[ends.parts]]
        by_bending = slopes.by_forces[:, None] @ forces[ends.parts] + slopes.by_ends @ at_ends
        by_shear = (slopes.by_shear / frame.section[2, ends.parts])[:, None]
        inclinations = ends.weights @ (by_bending[:, 0] + by_shear * changes[3, ends.parts])
        # A guide ring moves toward or away from a load point.
        by_length = (ends.by_length @ slopes.values)[:, None]
        inclinations += by_length * changes[0, ends.between]
        return TubeRates(frame.motions(unknowns), inclinations, forces)


def _first(values: Array | Indices) -> Any:
    """Return values (k,) of the first sample, or of the only one."""
    return values.reshape(-1, values.shape[-1])[0]


def _flat(loads: Array) -> Array:
    """Return loads (..., k, 3) as vectors (..., 3k)."""
    return loads.reshape(*loads.shape[:-2], -1)


def _apply(matrices: Array, vectors: Array) -> Array:
    """Return products (..., r) of matrices (..., r, c) with vectors (..., c)."""
    return (matrices @ vectors[..., None])[..., 0]


def group_cuts(structure: Structure, members: Indices, positions: Array) -> list[Indices]:
    """Return the samples of each group whose members are divided alike at positions (n, k)."""
    if len(positions) == 1:
        return [np.zeros(1, dtype=int)]
    return _group(structure, Cuts.of(structure, members, positions))


def _group(structure: Structure, cuts: Cuts, *others: Array | Flags) -> list[Indices]:
    """Return the samples of each group with equal layouts of cuts and equal other values."""
    if len(cuts.pieces) == 1:
        return [np.zeros(1, dtype=int)]
    order = np.lexsort((cuts.within, cuts.pieces), axis=-1)
    columns = cuts.pieces, order, _are_at_rings(structure, cuts), *others
    groups = defaultdict[bytes, list[int]](list)
    for i, row in enumerate(zip(*columns, strict=True)):
        groups[b''.join(values.tobytes() for values in row)].append(i)
    return list(map(np.array, groups.values()))


def _active(layout: Layout, loaded: Flags) -> Indices:
    """Return the active blocks of a layout and the kept blocks (b,) that loads deform."""
    if not loaded.any():
        return layout.active
    return np.sort(np.append(layout.active, layout.kept_ids[loaded]))


def _are_at_rings(structure: Structure, cuts: Cuts) -> Flags:
    """Return whether cuts are at the start and at the end (..., 2k) of their piece."""
    lengths = pick(structure.frame.length, cuts.pieces)
    ends = np.concatenate([cuts.within, lengths - cuts.within], axis=-1)
    return ends < RING_HALF_WIDTH
