# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bent tubes with load points, linearised about a state and condensed to the points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.numerics.samples import apply
from isotruss_ros.core.numerics.tolerances import MAX_CONDITION
from isotruss_ros.core.statics.frame import end_forces, Frame, largest_motion
from isotruss_ros.core.statics.structure import Cuts, InclinationWeights, Lines, Structure
from isotruss_ros.core.statics.tangent import irregular_loads, linearize, Slopes, Tangent
import numpy as np

# Responses of bent tubes to unit loads and to unit motions of k load points.
#
# If a load point moves along its member, the part before it becomes longer and the part behind it
# shorter.


class LoadResponses(NamedTuple):
    """
    Changes of bent tubes by unit loads and by unit motions of k load points along their members.

    The columns are 3k loads, k motions, and a last one for the loads that the linearised state
    lacks for equilibrium.
    """

    unknowns: Array  #: (u, 4k + 1) changes of the frame's unknowns
    #: (k, 4, 4k + 1) changes of the responses, see `BentTubes`; the last column is their value
    at_points: Array


def find_slopes(structure: Structure, tangent: Tangent) -> tuple[InclinationWeights, Slopes]:
    """Return the weights of the inclinations, and the inclinations that they weight."""
    ends = InclinationWeights.of(structure, tangent.frame)
    return ends, tangent.slopes(ends.parts, ends.signs)


def find_responses(
    structure: Structure, tangent: Tangent, turns: Array, loads: Array, length_by_motions: Array
) -> LoadResponses:
    """
    Return the responses about a linearised state under loads (k, 3).

    For `turns` see `Lines`. The lengths of the frame's parts change by `length_by_motions` (p, k)
    for unit motions of the load points.
    """
    frame, layout, count = tangent.frame, tangent.frame.layout, turns.shape[-3]
    motions, points = slice(3 * count, 4 * count), np.arange(count)
    right = _right_sides(tangent, turns, loads, length_by_motions)
    # Straight tubes lack no loads for equilibrium, so the last column is free for a probe.
    is_probed = not layout.kept and not tangent.unknowns.any()
    if is_probed:
        right[..., -1] = irregular_loads(frame)
    try:
        _, unknowns = tangent.solve(right)
    except StructureError:  # as of one of several samples
        unknowns = np.full(right.shape, np.nan)
    if is_probed:
        condition = np.abs(unknowns[..., -1] / frame.scale).max()
        if not condition < MAX_CONDITION:
            _ = structure.unloaded  # raises an error that names the moving parts
        unknowns[..., -1] = 0.0
    # Displacements of the nodes in axes of the members, relative to their places, which move along
    # the members. The nodes are the last ones.
    to_member = turns.swapaxes(-1, -2)
    *lead, size, columns = unknowns.shape
    last_rows = slice(size - 3 * count, None)
    of_nodes = unknowns[..., last_rows, :].reshape(*lead, count, 3, columns)
    at_points = np.empty((*lead, count, 4, columns))
    at_points[..., :3, :] = to_member @ of_nodes
    at_points[..., points, 0, motions.start + points] -= 1.0
    # The last column includes the responses in the linearised state.
    at_points[..., :3, -1] += apply(to_member, tangent.displacements[..., -count:, :])
    at_points[..., 3, :] = at_points[..., 2, :]  # rotations of the sections
    # Inclinations. The length of a part between two load points depends on both.
    ends, slopes = find_slopes(structure, tangent)
    at_ends = unknowns.take(layout.places[ends.parts], axis=-2)
    of_ends = (slopes.by_ends @ at_ends)[..., 0, :]
    rates = slopes.by_forces * tangent.length_rates.take(ends.parts, axis=-2)
    of_ends[..., motions] += rates.sum(axis=-1)[..., None] * length_by_motions[ends.parts]
    of_ends[..., -1] += slopes.values
    at_points[..., 2, :] = ends.weights @ of_ends
    if ends.is_at_ring:
        weight_rates = ends.by_length @ of_ends[..., -1, None]
        at_points[..., 2, motions] += weight_rates * length_by_motions[ends.between]
    return LoadResponses(unknowns, at_points)


def _right_sides(tangent: Tangent, turns: Array, loads: Array, length_by_motions: Array) -> Array:
    """Return the loads (u, 4k + 1) to which the columns of `LoadResponses` respond."""
    parts, count = tangent.frame.layout.parts, turns.shape[-3]
    right = np.zeros((*tangent.unknowns.shape, 4 * count + 1))
    # Unit loads on the nodes at the load points, which are the last ones; from member axes.
    node_rows, load_columns = tangent.frame.layout.unit_loads
    right[..., node_rows, load_columns] = turns
    # Forces of lengthened parts.
    by_motions = length_by_motions[parts, None]
    forces = tangent.length_rates.take(parts, axis=-2)[..., None] * by_motions
    right[..., slice(3 * count, 4 * count)] = -tangent.sum_forces(parts, forces)
    # Loads without equilibrium in the linearised state: unit loads are on the last nodes only.
    right[..., -1] = -tangent.assembled.carried
    on_nodes = right[..., slice(-3 * count, None), -1].reshape(loads.shape)
    on_nodes += apply(turns, loads)
    return right


# Bent tubes of n samples with k load points, linearised about a state and condensed to the points.
#
# The state does not depend on the pieces of the frame in which the load points are, and the
# linearised tubes are a function of it. Tubes without loads are kept undeformed, see
# `UnloadedBlocks`, until loads deform them.

#: Largest force on a hinge of a tube that is kept undeformed [N]; it displaces nodes by about
#: 1e-11 m, and rounding errors are below 1e-10. It grows by 1e5 N/m^2 times the square of the
#: motion of nodes, as the forces that a linearisation leaves. With a thirtieth of this growth,
#: the tubes of nine_member are deformed in every grasp; with a tenth of it, in some.
KEPT_FORCE = 1e-8
#: The square of a load point's motion, divided by the length of the shorter part beside it and
#: multiplied by this length, counts as the square of a node's motion [m].
PLACE_LENGTH = 0.02
#: Largest motion of a load point across a guide ring, for which the tubes may be linearised at the
#: ring, in tube radii [-]. With a third of it, 400 random grasps have the same equilibria; with
#: three times of it, one that is far from the start is not found.
RING_REACH = 0.1


class BentState(NamedTuple):
    """Bent frames of n samples with k load points; it does not know the pieces of the points."""

    nodes: Array  #: (n, u) unknowns of the frame without load points, see `Tangent`
    points: Array  #: (n, k, 3) displacements of the load points [m, rad]
    axial: Array  #: (n, p + k) axial forces of the members, and of the parts behind the points [N]
    places: Array  #: (n, k) distances of the load points from the starts of their members [m]
    crossings: Array  #: (n, k) number of times that a point near a guide ring crossed it
    deformed: Flags  #: (n, b) blocks of the frame that loads deform

    @classmethod
    def straight(cls, structure: Structure, places: Array, deforms: bool) -> BentState:
        """Return tubes without loads; all of them deform from the start if `deforms` is true."""
        frame, (n, k) = structure.frame, places.shape
        return cls(
            np.zeros(frame.scale.shape),
            np.zeros((n, k, 3)),
            np.zeros((n, frame.length.shape[-1] + k)),
            places.copy(),
            np.zeros((n, k)),
            np.full((n, len(frame.layout.numbering.blocks)), deforms),
        )

    def joined(self, structure: Structure) -> BentState:
        """Return the state in which the blocks that deform in any sample deform in all."""
        deforms = self.deformed.any(axis=0)
        lacking = deforms & ~self.deformed
        if not lacking.any():
            return self
        nodes = self.nodes.copy()
        for blocks in filter(None, structure.blocks):
            (chosen,) = np.nonzero(lacking[:, blocks.ids].any(axis=0))
            some, completed = blocks.chosen(chosen), self.nodes.copy()
            some.complete(completed)
            rows = lacking[:, some.ids, None]
            nodes[:, some.inner] = np.where(rows, completed[:, some.inner], nodes[:, some.inner])
        return self._replace(nodes=nodes, deformed=np.broadcast_to(deforms, lacking.shape).copy())

    def unknowns(self) -> Array:
        """Return the unknowns of a frame with nodes at the load points, (n, u + 3k)."""
        return np.concatenate([self.nodes, self.points.reshape(len(self.points), -1)], axis=-1)


class Motion(NamedTuple):
    """Change of tubes since their linearisation."""

    unknowns: Array  #: (n, u + 3k) changes of the unknowns
    forces: Array  #: (n, p, 3) changes of the `EndForces` of the parts
    chords: Array  #: (n, p) elongations of the parts [m]


@dataclass(frozen=True, eq=False)
class BentTubes:
    """
    Tubes of n samples with k load points in one layout, linearised about a state under loads.

    A load is (f_along, f_across, m): forces along and across the straight member, and a moment [N,
    N m]. A response is the displacement along and across the straight member [m], the inclination
    of the bent centre line, see `InclinationWeights`, and the rotation of the section [rad].
    """

    shared: ClassVar[tuple[str, ...]] = ('members', 'length_by_motions')
    structure: Structure  #: structural model of the robot
    members: Indices  #: (k,) index of the member of each load point in `Robot.member_names`
    lines: Lines  #: members of the load points
    cuts: Cuts  #: nodes at the load points
    state: BentState  #: state about which the tubes are linearised
    loads: Array  #: (n, 3k) loads in this state [N, N m]
    length_by_motions: Array  #: (p, k) changes of the parts' lengths by motions of the points
    tangent: Tangent  #: linearised frame
    #: (n, k, 4, 4k + 1) `at_points` from another process; None: found at first use
    received: Array | None = None

    @classmethod
    def of(
        cls,
        structure: Structure,
        members: Indices,
        lines: Lines,
        state: BentState,
        loads: Array,
        received: Array | None = None,
    ) -> BentTubes:
        """Return the tubes linearised about a state in one layout."""
        cuts = Cuts.of(structure, members, state.places)
        frame = frame_of(structure, cuts, state)
        layout, k = frame.layout, len(members)
        axial = np.concatenate(
            [state.axial.take(layout.whole[:-k], axis=-1), state.axial[:, -k:]], axis=-1
        )
        kept = structure.kept_blocks(layout)
        tangent = linearize(frame, state.unknowns(), axial, kept)
        by_motions = layout.length_by_motions * cuts.directions[0]
        fields = structure, members, lines, cuts, state, loads, by_motions, tangent
        return cls(*fields, received)

    @cached_property
    def responses(self) -> LoadResponses:
        """Return the responses to loads and to motions of the load points."""
        at_points = self.loads.reshape(*self.state.places.shape, 3)
        return find_responses(
            self.structure, self.tangent, self.lines.turns, at_points, self.length_by_motions
        )

    @property
    def at_points(self) -> Array:
        """Return the responses (n, k, 4, 4k + 1) at the load points, see `LoadResponses`."""
        return self.responses.at_points if self.received is None else self.received

    def respond(self, loads: Array, positions: Array) -> Array:
        """Return the responses (n, k, 4) under loads (n, 3k) at positions (n, k)."""
        return apply(self.at_points, self._factors(loads, positions)[:, None])

    @cached_property
    def curvatures(self) -> Array:
        """Return the means (n, k) of the rotations' slopes on both sides of the points [1/m]."""
        layout, forces = self.tangent.frame.layout, self.tangent.forces.values
        ends = end_forces(forces, self.tangent.length)
        flexural = self.tangent.frame.section[..., 1, :]
        before, behind = layout.before, layout.behind
        bent = ends[:, before, 5] / flexural[:, before], ends[:, behind, 2] / flexural[:, behind]
        return 0.5 * self.cuts.directions * (bent[0] - bent[1])

    def move(self, loads: Array, positions: Array) -> Motion:
        """Return the changes of the tubes under loads (n, 3k) with points at positions (n, k)."""
        factors, motions = self._factors(loads, positions), positions - self.cuts.places
        if self.received is not None and not factors[:, :-1].any():  # in the state itself
            unknowns = np.zeros(self.tangent.unknowns.shape)
        else:
            unknowns = apply(self.responses.unknowns, factors)
        by_nodes, chords = self.tangent.force_changes(
            self.tangent.frame.displacements(unknowns)[..., None]
        )
        lengths = apply(self.length_by_motions, motions)
        forces = by_nodes[..., 0] + self.tangent.length_rates * lengths[..., None]
        return Motion(unknowns, forces, chords[..., 0])

    def moved(self, loads: Array, positions: Array) -> tuple[BentState, Array]:
        """Return the state under loads (n, 3k) with points at positions, and motions (n,) [m]."""
        state, structure, k = self.state, self.structure, len(self.members)
        frame, layout = self.tangent.frame, self.tangent.frame.layout
        # A point that crosses a guide ring and returns is placed at the ring.
        near = np.abs(positions - self.cuts.places) < RING_REACH * structure.tube_radius
        cuts = Cuts.of(structure, self.members, positions)
        crossings = state.crossings + (near & (cuts.pieces != self.cuts.pieces))
        if (crossings > 1.0).any():
            rings = structure.nearest_rings(self.members, positions)
            positions = np.where(crossings > 1.0, rings, positions)
            crossings = np.where(crossings > 1.0, 0.0, crossings)
            cuts = Cuts.of(structure, self.members, positions)
        shifts = cuts.places - self.cuts.places
        # Points that move far beside short parts are interpolated on the bent tube instead.
        shorter = np.minimum(
            frame.length.take(layout.before, axis=-1), frame.length.take(layout.behind, axis=-1)
        )
        weighted = (np.abs(shifts) * np.sqrt(PLACE_LENGTH / shorter)).max(axis=-1)
        is_far = (np.abs(shifts) > 0.5 * shorter).any(axis=-1)
        if is_far.any():
            shifts = np.where(is_far[:, None], 0.0, shifts)
        change = self.move(loads, self.cuts.places + shifts)
        relative = change.unknowns.copy()
        first = relative.shape[-1] - 3 * k  # unknown of the load points
        points = relative[:, first:].reshape(-1, k, 3)
        # The displacement of a point is relative to its place, which moves along the member.
        along = self.lines.axis * shifts
        points[..., 0] -= along.real
        points[..., 1] -= along.imag
        motion = np.maximum(largest_motion(frame.displacements(relative)), weighted)
        whole = self.tangent.unknowns + relative
        nodes, points = whole[:, :first], whole[:, first:].reshape(-1, k, 3)
        if is_far.any():
            displaced = frame.displacements(self.complete(whole))
            at = frame.interpolate(displaced, cuts.pieces, cuts.within)
            points = np.where(is_far[:, None, None], at, points)
        axial = state.axial.copy()
        forces = self.tangent.forces.values[..., 0] + change.forces[..., 0]
        axial[:, layout.whole[:-k]] = forces[:, :-k]
        # Parts behind points that have changed their piece have the axial force of this piece.
        changes = cuts.pieces != self.cuts.pieces
        axial[:, -k:] = forces[:, -k:]
        if changes.any():
            of_pieces = np.take_along_axis(axial, cuts.pieces, -1)
            axial[:, -k:] = np.where(changes, of_pieces, axial[:, -k:])
        deformed = state.deformed
        if layout.kept:
            loaded = self._find_loaded(change.unknowns)
            if loaded.any():
                deformed = deformed.copy()
                deformed[:, layout.kept_ids] |= loaded.any(axis=0)
                nodes = self.complete(whole)[:, :first]
        return BentState(nodes, points, axial, positions, crossings, deformed), motion

    def complete(self, unknowns: Array) -> Array:
        """Return unknowns (n, .) with those of undeformed tubes, which turn with their hinges."""
        kept, _, _ = self.tangent.kept
        if not kept:
            return unknowns
        completed = unknowns.copy()
        for blocks in kept:
            blocks.complete(completed)
        return completed

    def activated(self) -> BentTubes:
        """Return these tubes with the tubes that carry no loads deformable, too."""
        if not self.tangent.frame.layout.kept:
            return self
        state = self.activate(self.state)
        return BentTubes.of(self.structure, self.members, self.lines, state, self.loads)

    def activate(self, state: BentState) -> BentState:
        """Return a state that these tubes predict, with all tubes deformable."""
        if state.deformed.all():
            return state
        nodes = self.complete(state.unknowns())[:, : state.nodes.shape[-1]]
        return state._replace(nodes=nodes, deformed=np.ones_like(state.deformed))

    def end_forces(self, change: Motion) -> tuple[Array, Array]:
        """Return end forces (n, p, 6), and unscaled axial forces (n, p)."""
        forces = self.tangent.forces.values + change.forces
        return end_forces(forces, self.tangent.length + change.chords), forces[..., 0]

    def _factors(self, loads: Array, positions: Array) -> Array:
        """Return the weights (n, 4k + 1) of the columns of `LoadResponses`."""
        motions = positions - self.cuts.places
        return np.concatenate([loads - self.loads, motions, np.ones((len(loads), 1))], axis=-1)

    def _find_loaded(self, changes: Array) -> Flags:
        """Return which of the kept blocks (n, b) loads deform, see `UnloadedBlocks`."""
        motion = largest_motion(self.tangent.frame.displacements(changes))
        bound = KEPT_FORCE * (1.0 + 1e13 * motion**2)
        are_loaded = []
        for blocks, forces, stiffness in zip(*self.tangent.kept, strict=True):
            hinge_forces = forces + apply(stiffness, changes[:, blocks.outer])
            are_loaded.append(np.abs(hinge_forces).max(axis=-1) > bound[:, None])
        return np.concatenate(are_loaded, axis=-1)


def frame_of(structure: Structure, cuts: Cuts, state: BentState) -> Frame:
    """Return the frame with nodes at the load points, of the blocks that deform in any sample."""
    numbering = structure.frame.layout.numbering
    if state.deformed.all():
        active = structure.frame.layout.active
    else:
        deforms = state.deformed.any(axis=0)
        deforms[numbering.owner[cuts.pieces[0]]] = True
        deforms[numbering.hinged] = True
        active = np.flatnonzero(deforms)
    return structure.frame.cut(cuts.pieces[0], cuts.within, active)


class CenterLines(NamedTuple):
    """Bent centre lines of the tubes of n samples in one layout."""

    structure: Structure
    frame: Frame
    displacements: Array  #: (n, nodes, 3)

    @classmethod
    def of(cls, tubes: BentTubes, change: Motion) -> CenterLines:
        """Return the bent centre lines after a change since the linearisation."""
        frame, unknowns = tubes.tangent.frame, tubes.tangent.unknowns + change.unknowns
        return cls(tubes.structure, frame, frame.displacements(tubes.complete(unknowns)))

    def at(self, members: Indices, positions: Array) -> tuple[Points, Points]:
        """Return points (n, c) of the lines, and their rotations exp(i theta)."""
        config: Any = self.structure.config
        pieces, within, _ = self.structure.locate(members, positions)
        moved = self.frame.interpolate(self.displacements, pieces, within)
        starts = config.points[..., config.robot.topology.b[members]]
        straight = starts + positions * config.member_axes[..., members]
        return straight + (moved[..., 0] + 1j * moved[..., 1]), np.exp(1j * moved[..., 2])


# Derivatives of the bent tubes of one sample by loads, load points, and sections.


class TubeRates(NamedTuple):
    """Derivatives of the tubes' displacements and forces with respect to p parameters."""

    #: (n, 3, p) of the displacements of the frame's nodes [m, rad]; zero inside of kept tubes
    nodes: Array
    inclinations: Array  #: (k, p) of the bent centre lines at the load points [rad]
    forces: Array  #: (c, 3, p) of the `EndForces` of the frame's parts with fixed nodes


def find_load_changes(bent: BentTubes, loads: Array, motions: Array) -> TubeRates:
    """Return the tubes' changes by p changes of loads (k, 3, p) and of positions (k, p)."""
    factors = np.concatenate([loads.reshape(-1, loads.shape[2]), motions])
    nodes = bent.tangent.frame.motions(bent.responses.unknowns[:, :-1] @ factors)
    inclinations = bent.at_points[:, 2, :-1] @ factors
    lengths = (bent.length_by_motions @ motions)[:, None]
    return TubeRates(nodes, inclinations, bent.tangent.length_rates[..., None] * lengths)


def find_section_changes(bent: BentTubes, changes: Array, nodes: Points) -> TubeRates:
    """
    Return the tubes' changes by p changes of sections (4, c, p) of the frame's parts.

    The nodes of the undeformed robot move by `nodes` (n, p), x + iy. Tubes that are kept
    undeformed move alike, in axes that turn with them.
    """
    frame, tangent = bent.tangent.frame, bent.tangent
    ends, slopes = find_slopes(bent.structure, tangent)
    # Forces of the changed parts between fixed nodes, then the unknowns in equilibrium.
    parts = np.flatnonzero(changes.any(axis=(0, 2)))
    forces = np.zeros((len(frame.length), 3, changes.shape[2]))
    forces[parts] = tangent.force_rates(parts) @ changes[:, parts].swapaxes(0, 1)
    right = -tangent.sum_forces(parts, forces[parts])
    for blocks, _, stiffness in zip(*tangent.kept, strict=True):
        hinges = nodes[(blocks.outer[:, ::2] - frame.layout.numbering.rows) // 3]
        moved = blocks.turn_motions(tangent.unknowns, hinges)
        np.add.at(right, blocks.outer, stiffness @ moved)
    _, unknowns = tangent.solve(right)
    at_ends = unknowns[frame.layout.places[ends.parts]]
    by_bending = slopes.by_forces[:, None] @ forces[ends.parts] + slopes.by_ends @ at_ends
    by_shear = (slopes.by_shear / frame.section[2, ends.parts])[:, None]
    inclinations = ends.weights @ (by_bending[:, 0] + by_shear * changes[3, ends.parts])
    # A guide ring moves toward or away from a load point.
    by_length = (ends.by_length @ slopes.values)[:, None]
    inclinations += by_length * changes[0, ends.between]
    return TubeRates(frame.motions(unknowns), inclinations, forces)
