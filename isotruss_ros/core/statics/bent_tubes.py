# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Compliance of tubes at places: the frame cut there, linearised about its bent state.

Motion of a place along its member lengthens the part before it and shortens the part behind it,
without other changes. So the response of the places is affine in loads and places, and other loads
shift it by a constant.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.tolerances import MAX_SEARCH_STEPS, NEGLIGIBLE_SHARE, ROUNDING
from isotruss_ros.core.statics.cut_frame import CutFrame, keep_apart
from isotruss_ros.core.statics.frame import end_forces, Frame, Tangent
from isotruss_ros.core.statics.structure import Structure
import numpy as np

#: Where a motion is followed, tubes are linearised anew until no node moves by more than this [m],
#: else `ROUNDING`: the error left is 15 /m times its square.
FOLLOWED_MOTION = 1e-4
#: Weight of motions of places against those of nodes, by the moments in tubes [-].
PLACE_SHARE = 0.2
#: Cuts are no nearer to each other and to the ends of their piece of tube than this [m].
SHORTEST_PART = 1e-3


class Displaced(NamedTuple):
    """
    State of a bent frame, initial guess for another one.

    :ivar displacements: (n, 3) displacements ux, uy [m], theta [rad].
    :ivar multipliers: (c,) multipliers of the constraints.
    :ivar loads: (k, 3) loads at the places, see `BentTubes`.
    :ivar pull: (c,) axial forces of the members [N].
    """

    displacements: Array
    multipliers: Array
    loads: Array
    pull: Array


class PlaceChanges(NamedTuple):
    """
    Changes by motion of the places along their members at constant loads, in p cases.

    :ivar nodes: (n, 3, p) motion of the nodes [m, rad].
    :ivar inclined: (k, p) inclinations at the places with fixed nodes [rad].
    :ivar forces: (c, 3, p) forces N, M1 and M2 of the members with fixed nodes [N], [N m].
    """

    nodes: Array
    inclined: Array
    forces: Array


@dataclass(frozen=True, eq=False)
class BentTubes:
    """
    The tubes of a robot at k places, linearised about a bent state.

    Loads are forces along and across the straight member and a moment (f_along, f_across, m) [N],
    [N m]. Responses are displacements along and across the member [m], and the inclination of the
    bent centre line [rad]. At the kink under a force the inclination is the mean of both sides.

    :ivar structure: frame of the robot.
    :ivar members: (k,) indices of the members in `Robot.member_names`; repeated for two places.
    :ivar places: (k,) distances of the cuts from the members' starts [m].
    :ivar stiffness: stiffness of the structure relative to the model [-].
    :ivar linear: linear about straight tubes, as in the paper.
    :ivar before: state of the linearisation; None: without loads.
    :ivar shortest: smallest distance of the cuts from the ends of pieces of tube [m].
    """

    structure: Structure
    members: Indices
    places: Array
    stiffness: float = 1.0
    linear: bool = False
    before: Displaced | None = None
    shortest: float = SHORTEST_PART

    @cached_property
    def start(self) -> Points:
        """Return the pinch points at the starts of the members, (k,) x + iy [m]."""
        config = self.structure.config
        return config.points[config.robot.topology.b[self.members]]

    @cached_property
    def length(self) -> Array:
        """Return the lengths of the members, pinch to pinch, (k,) [m]."""
        return self.structure.config.member_lengths[self.members]

    @cached_property
    def axis(self) -> Points:
        """Return the directions of the members, from the start, (k,)."""
        config, topology = self.structure.config, self.structure.config.robot.topology
        end = config.points[topology.c[topology.following[self.members]]]
        return (end - self.start) / self.length

    @cached_property
    def _cut(self) -> tuple[Frame, Array, Array]:
        """Return the frame, the directions (k,) of its pieces, and its cuts [m]."""
        frame = self.structure.frame
        if not len(self.members):
            return frame, self.places, self.places
        pieces, within, ahead = self.structure.locate(self.members, self.places)
        inside = keep_apart(pieces, within, frame.length[pieces], self.shortest)
        return CutFrame(frame, pieces, inside), ahead, self.places + ahead * (inside - within)

    def bent_to(self, before: Displaced | None) -> BentTubes:
        """
        Return these tubes, linearised about another state.

        :param before: the state; None without loads.
        """
        found = replace(self, before=before)
        found.__dict__['_cut'] = self._cut
        return found

    def bent_like(self, others: BentTubes) -> BentTubes:
        """
        Return these tubes, linearised about the state of a similar robot.

        :param others: the other tubes.
        """
        if others.before is None:
            return self
        displacements, multipliers, _, pull = others.before
        frame, known = self.frame, others.frame
        whole, nodes = frame.whole, displacements[: len(frame.points) - len(frame.nodes)]
        longer = (others.structure.frame.length / self.structure.frame.length)[whole]
        inner, middles = longer * frame.begins, longer * (frame.begins + 0.5 * frame.length)
        own = known.interpolate(displacements, whole[frame.behind], inner[frame.behind])
        part, _ = known.locate(whole, middles)
        displaced = np.append(nodes, own, axis=0), multipliers, np.zeros((len(own), 3)), pull[part]
        return self.bent_to(Displaced(*displaced))

    @property
    def ahead(self) -> Array:
        """Return 1 for pieces of tube along their member, -1 for backward ones, (k,)."""
        return self._cut[1]

    @property
    def cuts(self) -> Array:
        """Return the distances of the cuts from the members' starts, (k,) [m]."""
        return self._cut[2]

    @property
    def is_straight(self) -> bool:
        """Return whether the tubes are linearised without loads."""
        return self.before is None

    @property
    def frame(self) -> Frame:
        """Return the frame, cut at the places."""
        return self._cut[0]

    def locate(self, members: Indices, places: Array) -> tuple[Indices, Array, Array]:
        """
        Return the members of the cut frame at places, see `Structure.locate`.

        :param members: (c,) indices of the members.
        :param places: (c,) distances from the members' starts [m].
        """
        piece, within, ahead = self.structure.locate(members, places)
        return *self.frame.locate(piece, within), ahead

    @cached_property
    def share(self) -> float:
        """Return the share of the frame in the responses."""
        return NEGLIGIBLE_SHARE if self.linear else 1.0

    @cached_property
    def tangent(self) -> Tangent:
        """
        Return the frame linearised.

        :raises StructureError: the structure is a mechanism.
        """
        if self.before is None:
            return self.frame.rest
        displacements, multipliers, _, pull = self.before
        return self.frame.tangent(displacements, multipliers, pull)

    def _spread(self, loads: Array) -> Array:
        """Return loads (k, 3, p) at the places as loads (3 n, p) on the nodes."""
        frame, found = self.frame, np.zeros((len(self.frame.points), 3, loads.shape[2]))
        plane = (loads[:, 0] + 1j * loads[:, 1]) * self.axis[:, None]
        found[frame.nodes] = np.stack([plane.real, plane.imag, loads[:, 2]], axis=1)
        return found.reshape(-1, loads.shape[2]) * (self.share / self.stiffness)

    @cached_property
    def _changes(self) -> tuple[Array, Array]:
        """Return the displacements (n, 3, p) by unit loads (3 k), places (k) and residual."""
        tangent, count = self.tangent, len(self.members)
        units = self._spread(np.eye(3 * count).reshape(count, 3, -1))
        known = np.zeros((count, 3)) if self.before is None else self.before.loads
        left = self._spread(known[:, :, None]) - tangent.carried[:, None]
        moved, multipliers = tangent.respond(
            np.hstack([units, -self._place_rates[0], left]),
            np.append(np.zeros((len(tangent.gaps), 4 * count)), -tangent.gaps[:, None], axis=1),
        )
        return moved.reshape(-1, 3, 4 * count + 1), multipliers

    @property
    def _moving(self) -> slice:
        """Return the columns of `_changes` by the places."""
        count = len(self.members)
        return slice(3 * count, 4 * count)

    @cached_property
    def _place_rates(self) -> tuple[Array, Array, Array]:
        """Return loads (3 n, k), inclinations (k, k), and forces of parts (2 k, 3), by places."""
        frame, tangent, count = self.frame, self.tangent, len(self.members)
        carried, inclined = np.zeros((len(frame.points) * 3, count)), np.zeros((count, count))
        if self.before is None:
            return carried, inclined, np.zeros((2 * count, 3))
        parts, end = self._parts
        # The part before a place becomes longer as this moves, the one behind it shorter.
        ways = np.append(self._cut[1], -self._cut[1])[:, None, None]
        rates = tangent.forces.rates[parts, :, None] * ways
        forces, own = frame.nodal_forces(tangent, parts, rates)[..., 0], np.arange(count)[:, None]
        carried[frame.places[frame.before], own] = forces[:count]
        carried[frame.places[frame.behind], own] += forces[count:]
        # A part between two places of one member has both at its ends.
        longer = (parts[:, None] == frame.before) * self._cut[1]
        longer -= (parts[:, None] == frame.behind) * self._cut[1]
        changes = tangent.forces.rates[parts, :, None] * longer[:, None]
        inclined = self._mean(frame.slope_rates(tangent, parts, end, changes, 0.0))
        return carried, inclined, rates[..., 0]

    @cached_property
    def _parts(self) -> tuple[Indices, Indices]:
        """Return the parts (2 k,) before and behind all places, and their ends there."""
        count = len(self.members)
        return np.append(self.frame.before, self.frame.behind), np.repeat([2, 1], count)

    def _mean(self, sides: Array) -> Array:
        """Return the means of both sides of the places, (k, ...)."""
        count = len(self.members)
        return 0.5 * (sides[:count] + sides[count:])

    @cached_property
    def _rows(self) -> tuple[Array, Array]:
        """Return the responses (k, 3) in the state, and their changes (k, 3, p) by `_changes`."""
        frame, tangent, back = self.frame, self.tangent, self.axis.conj()
        moved, _ = self._changes
        own = tangent.displacements[frame.nodes]
        there = (own[:, 0] + 1j * own[:, 1]) * back
        nodes = moved[frame.nodes]
        along = (nodes[:, 0] + 1j * nodes[:, 1]) * back[:, None]
        slope = self._mean(frame.slopes(tangent, *self._parts))
        inclined = self.inclination_changes(moved)
        return (
            np.stack([there.real, there.imag, slope], axis=1),
            np.stack([along.real, along.imag, inclined], axis=1),
        )

    @cached_property
    def matrix(self) -> Array:
        """Return the responses to unit loads, (k, 3, k, 3)."""
        count = len(self.members)
        return (self._rows[1][:, :, : 3 * count] / self.share).reshape(count, 3, count, 3)

    @cached_property
    def rates(self) -> Array:
        """Return the derivatives of the responses by the places, (k, 3, k) [1/m]."""
        count = len(self.members)
        found = self._rows[1][..., self._moving].copy()
        own = np.arange(count)
        found[:, 2] += self._place_rates[1]
        if self.before is not None:
            # The place itself moves along its member.
            found[own, 0, own] -= 1.0
            return found / self.share
        return np.zeros_like(found)

    @cached_property
    def given(self) -> Array:
        """Return the responses without loads, with all places at the starts, (k, 3)."""
        state, changes = self._rows
        found = (state + changes[..., -1]) / self.share
        if self.before is not None:
            found -= np.einsum('iajb,jb->ia', self.matrix, self.before.loads)
        return found - self.rates @ self._cut[2]

    def respond(self, loads: Array, places: Array) -> Array:
        """
        Return the responses (k, 3).

        :param loads: (k, 3) loads at the places.
        :param places: (k,) distances from the members' starts [m].
        """
        moved = np.einsum('iajb,jb->ia', self.matrix, loads)
        return self.given + moved + self.rates @ places

    def distance(self, loads: Array, places: Array) -> float:
        """
        Return the largest motion of a node from the state of the linearisation [m].

        :param loads: (k, 3) loads at the places.
        :param places: (k,) distances from the members' starts [m].
        """
        ways = self._ways(loads, places)
        moved = np.abs(self._displace(ways)[0][:, :2]).max() / self.share
        # What is not linear in the places is that much less.
        slid = PLACE_SHARE * np.abs(ways[self._moving]).max()
        return float(max(moved, slid))

    def _displace(self, ways: Array) -> tuple[Array, Array]:
        """Return changes of displacements (n, 3) and the motion of nodes (n, 3), see `_ways`."""
        nodes = self._changes[0] @ ways
        moved = nodes.copy()
        if self.before is not None:
            # Places are where they move to.
            slid = self.axis * ways[self._moving]
            moved[self.frame.nodes, :2] -= np.column_stack([slid.real, slid.imag])
        return moved, nodes

    def _ways(self, loads: Array, places: Array) -> Array:
        """Return the factors of `_changes` that lead to loads and places."""
        known = 0.0 if self.before is None else self.before.loads
        return np.concatenate([(loads - known).ravel(), places - self._cut[2], [1.0]])

    def displace(self, loads: Array, places: Array) -> Displaced:
        """
        Return the linear prediction of the state of the frame.

        :param loads: (k, 3) loads at the places.
        :param places: (k,) distances from the members' starts [m].
        """
        ways, tangent = self._ways(loads, places), self.tangent
        moved, nodes = self._displace(ways)
        displacements = tangent.displacements + moved
        multipliers = tangent.multipliers + self._changes[1] @ ways
        pull = tangent.forces.pull + self._force_changes(ways, nodes)[0][:, 0]
        return Displaced(displacements, multipliers, loads, pull)

    def update(self, loads: Array, places: Array, structure: Structure | None = None) -> BentTubes:
        """
        Return the tubes linearised about the predicted state.

        :param loads: (k, 3) loads at the places.
        :param places: (k,) distances from the members' starts [m].
        :param structure: new frame of the robot; None: unchanged.
        """
        return BentTubes(
            structure or self.structure,
            self.members,
            places,
            self.stiffness,
            self.linear,
            self.displace(loads, places),
        )

    def bend(self, loads: Array, places: Array) -> BentTubes:
        """
        Return the tubes linearised about their equilibrium under loads.

        :param loads: (k, 3) loads at the places.
        :param places: (k,) distances from the members' starts [m].
        :raises StructureError: no equilibrium is found.
        """
        bent = self
        for _ in range(MAX_SEARCH_STEPS):
            if bent.distance(loads, places) <= ROUNDING:
                return bent
            bent = bent.update(loads, places)
        raise StructureError(f'the bent tubes did not settle in {MAX_SEARCH_STEPS} steps')

    def changes(self, loads: Array, places: Array) -> tuple[Array, PlaceChanges]:
        """
        Return the changes of the frame by further loads and by motion of the places.

        :param loads: (k, 3, p) loads at the places.
        :param places: (k, p) motion of the places along the members [m].
        :return: motion of the nodes by loads, (n, 3, p), and the changes by the places.
        """
        frame, count, found = self.frame, len(self.members), self._changes[0]
        by_loads = found[..., : 3 * count] @ loads.reshape(3 * count, -1)
        nodes = found[..., self._moving] @ places
        forces = np.zeros((len(frame.length), 3, places.shape[1]))
        moved = np.tile(places, (2, 1))
        np.add.at(forces, self._parts[0], self._place_rates[2][..., None] * moved[:, None])
        return by_loads, PlaceChanges(nodes, self._place_rates[1] @ places, forces)

    def inclination_changes(self, moved: Array) -> Array:
        """
        Return the changes of the inclinations at the places by motion of the nodes, (k, p) [rad].

        :param moved: (n, 3, p) displacements ux, uy [m], theta [rad].
        """
        return self._mean(self.frame.slope_changes(self.tangent, *self._parts, moved))

    def node_changes(self, loads: Array) -> Array:
        """
        Return the motion of the frame's nodes by further loads, (n, 3, p) [m, rad].

        :param loads: (k, 3, p) loads at the places.
        """
        count = 3 * len(self.members)
        return self._changes[0][..., :count] @ loads.reshape(count, -1) / self.share

    def displacements(self, loads: Array, places: Array) -> Array:
        """
        Return the linear prediction of the displacements of the nodes, (n, 3).

        :param loads: (k, 3) loads at the places.
        :param places: (k,) distances from the members' starts [m].
        """
        return self.displace(loads, places).displacements / self.share

    def end_forces(self, loads: Array, places: Array) -> tuple[Array, Array]:
        """
        Return the linear prediction of the forces of the nodes on all members.

        :param loads: (k, 3) loads at the places.
        :param places: (k,) distances from the members' starts [m].
        :return: (c, 6) forces, see `FrameState`, and (c,) axial forces that change the moments
            inside.
        """
        tangent, ways = self.tangent, self._ways(loads, places)
        changes, longer = self._force_changes(ways, self._displace(ways)[1])
        pull, moments = (
            tangent.forces.pull + changes[:, 0],
            tangent.forces.moments + changes[:, 1:],
        )
        ends = end_forces(pull, moments, tangent.length + longer)
        return self.stiffness / self.share * ends, 0.0 * pull if self.linear else pull

    def _force_changes(self, ways: Array, nodes: Array) -> tuple[Array, Array]:
        """Return the changes of N, M1 and M2 of the members (c, 3) and of their chords (c,)."""
        changes, longer = self.frame.force_changes(self.tangent, nodes[..., None])
        changes, slid = changes[..., 0], np.tile(ways[self._moving], 2)
        np.add.at(changes, self._parts[0], self._place_rates[2] * slid[:, None])
        return changes, longer[:, 0]

    def section_changes(self, changes: Array) -> tuple[Array, Array, Array]:
        """
        Return the changes of the frame by sections and rest lengths at constant loads and places.

        In the paper's model the effect of loads is scaled by `NEGLIGIBLE_SHARE`.

        :param changes: (4, c, p) changes of rest length [m], EA [N], EI [N m^2] and GA [N].
        :return: motion of the nodes (n, 3, p), changes of the inclinations (k, p), and of N, M1
            and M2 of the members with fixed nodes (c, 3, p).
        """
        frame, tangent = self.frame, self.tangent
        every = np.arange(len(frame.length))
        units = np.broadcast_to(np.eye(4)[:, None], (4, len(every), 4))
        rates = np.einsum('cfi,icp->cfp', frame.force_rates(tangent, every, units), changes)
        carried = np.zeros((3 * len(frame.points), changes.shape[2]))
        np.subtract.at(carried, frame.places, frame.nodal_forces(tangent, every, rates))
        moved, _ = tangent.respond(carried)
        moved, (parts, end) = moved.reshape(-1, 3, changes.shape[2]), self._parts
        shear = changes[3, parts] / frame.members.shear[parts, None]
        inclined = self._mean(frame.slope_rates(tangent, parts, end, rates[parts], shear))
        return moved, inclined + self.inclination_changes(moved), rates
