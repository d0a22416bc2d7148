# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Compliance of the tubes at k load points, linearised about a bent state.

Each load point is a node that divides its member into parts; its place is its distance from the
start of the member. If it moves along the member, the part before it becomes longer and the part
behind it shorter. Tubes without loads are kept undeformed, see `UnloadedBlocks`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.statics.beam_column import end_forces
from isotruss_ros.core.statics.frame import Frame, keep_apart
from isotruss_ros.core.statics.structure import Structure
from isotruss_ros.core.statics.tangent import linearize, Tangent
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


class Displaced(NamedTuple):
    """State of a bent frame about which tubes are linearised."""

    unknowns: Array  #: (u,) unknowns of the frame, see `Tangent`
    loads: Array  #: (k, 3) loads at the load points, see `BentTubes` [N, N m]
    pull: Array  #: (p,) axial forces of the frame's parts [N]


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
        start, length = config.points[topology.b[members]], config.member_lengths[members]
        axis = config.member_axes[members]
        turns = np.zeros((len(members), 3, 3))
        turns[:, 0, 0] = turns[:, 1, 1] = axis.real
        turns[:, 1, 0], turns[:, 0, 1], turns[:, 2, 2] = axis.imag, -axis.imag, 1.0
        return cls(start, axis, length, turns)


@dataclass(frozen=True, eq=False)
class BentTubes:
    """
    Tubes of a robot with k load points, linearised about a bent state.

    A load is (f_along, f_across, m): forces along and across the straight member, and a moment [N,
    N m]. A response is the displacement along and across the straight member [m], and the
    inclination of the bent centre line [rad]. At a transverse force the line has a kink; there,
    the mean of the inclinations on both sides is used.
    """

    structure: Structure  #: structural model of the robot
    members: Indices  #: (k,) index of the member of each load point in `Robot.member_names`
    places: Array  #: (k,) distances of the load points from the members' starts [m]
    apart: Array  #: (k,) `places`, shifted so that no part is too short [m]
    lines: Lines  #: members of the load points
    frame: Frame  #: the structure's frame with additional nodes at the load points
    ahead: Array  #: (k,) 1 for load points on pieces that run along their member, else -1
    stiffness: float  #: factor on the modelled stiffness [-]
    before: Displaced  #: state about which the tubes are linearised

    @classmethod
    def of(
        cls,
        structure: Structure,
        members: Indices,
        positions: Array,
        stiffness: float = 1.0,
        values: Array | None = None,
    ) -> BentTubes:
        """Return the tubes linearised about the state `values`; None: without loads."""
        layout = structure.frame.layout
        pieces, inside, ahead, apart = _place_cuts(structure, members, positions)
        active = layout.active
        if values is None:
            active = np.union1d(layout.numbering.owner[pieces], layout.numbering.hinged)
        frame, lines = structure.frame.cut(pieces, inside, active), Lines.of(structure, members)
        ends = np.cumsum([len(frame.scale), 3 * len(members), len(frame.length)])
        values = np.zeros(ends[-1]) if values is None else values
        if values.shape != (ends[-1],):
            raise StructureError(f'bent tubes with {values.size} values: must be {ends[-1]}')
        unknowns, loads, pull = np.split(values, ends[:-1])
        before = Displaced(unknowns, loads.reshape(-1, 3), pull)
        places = positions, apart
        return cls(structure, members, *places, lines, frame, ahead, stiffness, before)

    @property
    def values(self) -> Array:
        """Return the state about which these tubes are linearised, with all blocks deformable."""
        before = self.before
        if self.frame.layout.kept:
            pieces, inside, *_ = _place_cuts(self.structure, self.members, self.places)
            frame = self.structure.frame.cut(pieces, inside)
            before = self._convert(before, frame, True)
            tangent = linearize(frame, before.unknowns, before.pull)
            before = before._replace(pull=tangent.forces.values[:, 0])
        return np.concatenate([part.ravel() for part in before])

    def activated(self) -> BentTubes:
        """Return these tubes with all blocks deformable."""
        if not self.frame.layout.kept:
            return self
        return BentTubes.of(self.structure, self.members, self.places, self.stiffness, self.values)

    @cached_property
    def _longer(self) -> Array:
        """Return the changes (p, k) of the parts' lengths by unit motions of the load points."""
        return self.frame.layout.longer * self.ahead

    @cached_property
    def tangent(self) -> Tangent:
        """Return the frame linearised about the state `before`."""
        kept = tuple(self.structure.blocks[i].take(rows) for i, rows in self.frame.layout.kept)
        return linearize(self.frame, self.before.unknowns, self.before.pull, kept)

    @cached_property
    def _changes(self) -> tuple[Array, Array]:
        """Return changes (u, p) and responses (k, 3, p) to unit loads and motions, and balance."""
        tangent, layout = self.tangent, self.frame.layout
        count, size, turns = len(self.members), len(tangent.unknowns), self.lines.turns
        load_points, cut, moving = np.arange(count), self._cut_unknowns, self._moving
        right = np.zeros((size, 4 * count + 1))
        columns = np.arange(3 * count).reshape(count, 1, 3)
        right[cut[:, :, None], columns] = turns / self.stiffness
        slopes, longer, by_length = tangent.slopes, self._longer, tangent.length_rates
        rates = by_length[layout.parts, :, None] * longer[layout.parts, None]
        right[:, moving] = -tangent.sum_forces(layout.parts, rates)
        # The length of a part between two places of one member depends on both places.
        changed = (slopes.by_forces * by_length[layout.beside]).sum(axis=1)
        right[:, -1] = right[:, : 3 * count] @ self.before.loads.ravel() - tangent.carried
        _, moved = tangent.solve(right)
        back = turns.swapaxes(1, 2)
        responses = back @ moved[cut]
        responses[:, 2] = _mean((slopes.by_ends @ moved[layout.places[layout.beside]])[:, 0])
        responses[:, 2, moving] += _mean(changed[:, None] * longer[layout.beside])
        # The displacement is relative to the place, which moves along its member.
        responses[load_points, 0, moving.start + load_points] -= 1.0
        state = (back @ tangent.unknowns[cut][:, :, None])[..., 0]
        state[:, 2] = _mean(slopes.values)
        responses[..., -1] += state
        return moved, responses

    @property
    def _cut_unknowns(self) -> Indices:
        """Return the indices (k, 3) of the displacements at the load points."""
        return np.arange(-3 * len(self.members), 0).reshape(-1, 3)

    @property
    def _moving(self) -> slice:
        """Return the columns of `_changes` that belong to the motions of the load points."""
        return slice(3 * len(self.members), 4 * len(self.members))

    @cached_property
    def matrix(self) -> Array:
        """Return the compliance (k, 3, k, 3): responses at the load points to unit loads."""
        count = len(self.members)
        return self._changes[1][:, :, : 3 * count].reshape(count, 3, count, 3)

    @cached_property
    def rates(self) -> Array:
        """Return the derivatives (k, 3, k) of the responses by `places` [-, -, rad/m]."""
        return self._changes[1][..., self._moving]

    @cached_property
    def given(self) -> Array:
        """Return the responses (k, 3), extrapolated to zero loads and zero positions."""
        none = np.zeros((len(self.members), 3))
        return self.respond(none, none[:, 0])

    def respond(self, loads: Array, positions: Array) -> Array:
        """Return the responses (k, 3), which are affine functions of loads and positions."""
        return self._changes[1] @ self._ways(loads, positions)

    def distance(self, loads: Array, positions: Array) -> float:
        """Return the largest motion of a node by loads, from where it is linearised [m]."""
        if (self.apart != self.places).any():
            # The nodes stay beside a node or another load point.
            *_, positions = _place_cuts(self.structure, self.members, positions)
        ways = self._ways(loads, positions)
        moved = np.abs(self.frame.displacements(self._displace(ways)[0])[:, :2]).max()
        parts = self.frame.length[self.frame.layout.beside].reshape(2, -1).min(axis=0)
        slid = np.abs(ways[self._moving]) * np.sqrt(PLACE_LENGTH / parts)
        return float(max(moved, slid.max()))

    def _displace(self, ways: Array) -> tuple[Array, Array]:
        """Return the unknowns' changes (u,) relative to the moving load points, and absolute."""
        changes = self._changes[0] @ ways
        moved = changes.copy()
        # The displacement is relative to the place, which moves along its member.
        slid = self.lines.axis * ways[self._moving]
        moved[self._cut_unknowns[:, 0]] -= slid.real
        moved[self._cut_unknowns[:, 1]] -= slid.imag
        return moved, changes

    def _ways(self, loads: Array, positions: Array) -> Array:
        """Return `ways` (p,), factors on the columns of `_changes`: loads, places, and 1."""
        more = (loads - self.before.loads).ravel()
        return np.concatenate([more, positions - self.apart, [1.0]])

    def update(
        self, loads: Array, positions: Array, structure: Structure | None = None
    ) -> BentTubes:
        """Return the tubes linearised about the state that these predict under loads."""
        structure = self.structure if structure is None else structure
        active = self._find_active(loads, positions, structure)
        pieces, inside, ahead, apart = _place_cuts(structure, self.members, positions)
        frame = structure.frame.cut(pieces, inside, active)
        # A node that moves by more than half of a part is interpolated on the bent member, because
        # the error of its extrapolation would turn the part.
        half = 0.5 * self.frame.length[self.frame.layout.beside].reshape(2, -1)
        near = bool((np.abs(apart - self.apart) <= half).all())
        ways, tangent = self._ways(loads, apart if near else self.apart), self.tangent
        moved, changes = self._displace(ways)
        pull = tangent.forces.values[:, 0] + self._force_changes(ways, changes)[0][:, 0]
        before = Displaced(tangent.unknowns + moved, loads, pull)
        if not near or frame.layout is not self.frame.layout:
            before = self._convert(before, frame, near)
        lines = self.lines
        if structure is not self.structure:
            lines = Lines.of(structure, self.members)
        fields = positions, apart, lines, frame, ahead, self.stiffness, before
        return BentTubes(structure, self.members, *fields)

    def _find_active(self, loads: Array, positions: Array, structure: Structure) -> Indices:
        """Return the blocks that given loads deform, see `UnloadedBlocks`."""
        layout, tangent = self.frame.layout, self.tangent
        if structure is not self.structure:  # its blocks are linearised once only
            return structure.frame.layout.active
        if not layout.kept:
            return layout.active
        changes, active = self._changes[0] @ self._ways(loads, positions), [layout.active]
        motion = np.abs(self.frame.displacements(changes)[:, :2]).max()
        for blocks, push, stiff in zip(*tangent.kept, strict=True):
            force = push + (stiff @ changes[blocks.outer][:, :, None])[..., 0]
            loaded = np.abs(force).max(axis=1) > KEPT_FORCE * (1.0 + 1e13 * motion**2)
            active.append(blocks.ids[loaded])
        return np.sort(np.concatenate(active))

    def _convert(self, state: Displaced, frame: Frame, near: bool) -> Displaced:
        """Convert a state to one of a similar frame; `near`: its cuts are displaced alike."""
        unknowns = self._complete(state.unknowns)
        longer = (self.structure.frame.length / frame.uncut.length)[frame.layout.whole]
        begins, middles = longer * frame.begins, longer * (frame.begins + 0.5 * frame.length)
        if not near:
            behind, nodes = frame.layout.behind, self.frame.displacements(unknowns)
            cut = self.frame.interpolate(nodes, frame.layout.whole[behind], begins[behind])
            unknowns = np.append(unknowns[: self._cut_unknowns[0, 0]], cut)
        part = self.frame.locate(frame.layout.whole, middles)
        pull = np.where(part < 0, np.nan, state.pull[part])
        return Displaced(unknowns, state.loads, pull)

    def _complete(self, unknowns: Array) -> Array:
        """Add the unknowns of undeformed tubes, which turn with their hinges, to unknowns (u,)."""
        completed = unknowns.copy()
        for blocks in self.tangent.kept[0]:
            blocks.complete(completed)
        return completed

    def changes(self, loads: Array, positions: Array) -> tuple[Array, Array, Array]:
        """Return the changes of deformed nodes, inclinations, forces by p loads and motions."""
        unknowns, responses = self._changes
        ways = np.concatenate([loads.reshape(-1, loads.shape[2]), positions])
        forces = self.tangent.length_rates[:, :, None] * (self._longer @ positions)[:, None]
        nodes = self.frame.displacements(unknowns[:, :-1] @ ways)
        return nodes, responses[:, 2, :-1] @ ways, forces

    def displacements(self, loads: Array, positions: Array) -> Array:
        """Return the linear prediction of the nodes' displacements, (n, 3) [m, rad]."""
        moved, _ = self._displace(self._ways(loads, positions))
        return self.frame.displacements(self._complete(self.tangent.unknowns + moved))

    def end_forces(self, loads: Array, positions: Array) -> tuple[Array, Array]:
        """Return linear predictions of end forces (p, 6), and of unscaled axial forces (p,)."""
        tangent, ways = self.tangent, self._ways(loads, positions)
        changes, longer = self._force_changes(ways, self._displace(ways)[1])
        forces = tangent.forces.values + changes
        ends = end_forces(forces, tangent.length + longer)
        return self.stiffness * ends, forces[:, 0]

    def _force_changes(self, ways: Array, changes: Array) -> tuple[Array, Array]:
        """Return the changes of `EndForces.values` (p, 3) and chord lengths (p,) by `ways`."""
        forces, longer = self.tangent.force_changes(self.frame.displacements(changes)[..., None])
        slid = (self._longer @ ways[self._moving])[:, None]
        return forces[..., 0] + self.tangent.length_rates * slid, longer[:, 0]

    def section_changes(self, changes: Array) -> tuple[Array, Array, Array]:
        """Return `changes` by p changes of sections; no tubes must be kept."""
        frame, tangent, parts = self.frame, self.tangent, self.frame.layout.beside
        count, chosen = changes.shape[2], np.flatnonzero(changes.any(axis=(0, 2)))
        units = np.broadcast_to(np.eye(4)[:, None], (4, len(chosen), 4))
        rates = np.zeros((len(frame.length), 3, count))
        rates[chosen] = tangent.force_rates(chosen, units) @ changes[:, chosen].swapaxes(0, 1)
        carried = tangent.sum_forces(chosen, rates[chosen])
        _, moved = tangent.solve(-carried)
        _, by_ends, by_forces, by_shear = tangent.slopes
        inclined = by_forces[:, None] @ rates[parts] + by_ends @ moved[frame.layout.places[parts]]
        shear = (by_shear / frame.section[2, parts])[:, None] * changes[3, parts]
        return frame.displacements(moved), _mean(inclined[:, 0] + shear), rates


def _place_cuts(
    structure: Structure, members: Indices, positions: Array
) -> tuple[Indices, Array, Array, Array]:
    """Return pieces with load points, distances (k,) from their starts, and `ahead`, `apart`."""
    pieces, within, ahead = structure.locate(members, positions)
    inside = keep_apart(pieces, within, structure.frame.length[pieces])
    return pieces, inside, ahead, positions + ahead * (inside - within)


def _mean(sides: Array) -> Array:
    """Return the mean (k, ...) of values (2 k, ...) before and behind each load point."""
    count = len(sides) // 2
    return 0.5 * (sides[:count] + sides[count:])
