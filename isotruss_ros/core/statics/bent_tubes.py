# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Compliance of the tubes at k load points, linearised about a bent state.

The frame has additional nodes at the load points: each load point divides its member into parts.
The place of a load point is its distance from the start of the member. If the load point moves
along the member, the part before it becomes longer and the part behind it shorter. The responses
are the displacements and inclinations at the load points; they are affine functions of loads and
places.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.tolerances import MAX_SEARCH_STEPS, NEGLIGIBLE_SHARE, ROUNDING
from isotruss_ros.core.statics.beam_column import end_forces
from isotruss_ros.core.statics.cut_frame import CutFrame, keep_apart
from isotruss_ros.core.statics.frame import Frame
from isotruss_ros.core.statics.structure import Structure
from isotruss_ros.core.statics.tangent import Slopes, Tangent
import numpy as np

#: Tubes are linearised again if a node has moved farther than this from the linearised state [m]:
#: for a moving robot, and for a single equilibrium. The error of predicted displacements is
#: `TUBE_CURVATURE` times the square of the motion; the relative error of a stiffness is
#: `TUBE_CURVATURE` times the motion. With ten times the second value, stiffnesses have errors of
#: 4e-9 if a contact is 0.5 mm from a guide ring, so that their differences err by 2e-6.
FOLLOWED_MOTION, SETTLED_MOTION = 1e-4, 1e-11
#: Weight of a load point's motion relative to a node's motion in `BentTubes.distance` [-].
PLACE_SHARE = 0.2


class Displaced(NamedTuple):
    """
    State of a bent frame about which tubes are linearised.

    :ivar displacements: (n, 3) displacements ux, uy [m], theta [rad].
    :ivar multipliers: (q,) Lagrange multipliers of the constraints.
    :ivar loads: (k, 3) loads at the load points, see `BentTubes` [N, N m].
    :ivar pull: (c,) axial forces of the frame's members [N].
    """

    displacements: Array
    multipliers: Array
    loads: Array
    pull: Array


class PlaceChanges(NamedTuple):
    """
    Changes of the frame if load points move along their members under constant loads.

    Each of the p columns is one motion of the load points. `inclined` and `forces` do not include
    the changes that `nodes` causes.

    :ivar nodes: (n, 3, p) displacements of the nodes [m, rad].
    :ivar inclined: (k, p) changes of the inclinations at the load points [rad].
    :ivar forces: (c, 3, p) changes of the members' forces, see `EndForces`.
    """

    nodes: Array
    inclined: Array
    forces: Array


@dataclass(frozen=True, eq=False)
class BentTubes:
    """
    Tubes of a robot with k load points, linearised about a bent state.

    A load is (f_along, f_across, m): forces along and across the straight member, and a moment [N,
    N m]. A response is the displacement along and across the straight member [m], and the
    inclination of the bent centre line [rad]. At a transverse force the line has a kink; there,
    the mean of the inclinations on both sides is used.

    :ivar structure: structural model of the robot.
    :ivar members: (k,) index of the member of each load point in `Robot.member_names`.
    :ivar places: (k,) distances of the load points from the members' starts [m].
    :ivar stiffness: factor on the modelled stiffness [-].
    :ivar linear: whether the model is the paper's linear one, with the equilibrium of the
        undeformed tubes.
    :ivar before: state about which the tubes are linearised; None: the state without loads.
    """

    structure: Structure
    members: Indices
    places: Array
    stiffness: float = 1.0
    linear: bool = False
    before: Displaced | None = None

    @cached_property
    def start(self) -> Points:
        """Return the pinch point at the start of each load point's member, (k,) x + iy [m]."""
        config = self.structure.config
        return config.points[config.robot.topology.b[self.members]]

    @cached_property
    def length(self) -> Array:
        """Return the length of each load point's member, pinch to pinch, (k,) [m]."""
        return self.structure.config.member_lengths[self.members]

    @cached_property
    def axis(self) -> Points:
        """Return the unit vector from start to end of each load point's member, (k,) x + iy."""
        config, topology = self.structure.config, self.structure.config.robot.topology
        end = config.points[topology.c[topology.following[self.members]]]
        return (end - self.start) / self.length

    @cached_property
    def _cut(self) -> tuple[Frame, Array, Array]:
        """Return the values of the properties `frame`, `ahead` and `cuts`."""
        frame = self.structure.frame
        if not len(self.members):
            return frame, self.places, self.places
        pieces, inside, ahead, cuts = self._locate_cuts(self.places)
        return CutFrame(frame, pieces, inside), ahead, cuts

    def _locate_cuts(self, places: Array) -> tuple[Indices, Array, Array, Array]:
        """Return the pieces of tubes, the cuts in them, `ahead` and `cuts` for load points."""
        pieces, within, ahead = self.structure.locate(self.members, places)
        inside = keep_apart(pieces, within, self.structure.frame.length[pieces])
        return pieces, inside, ahead, places + ahead * (inside - within)

    def bent_to(self, before: Displaced | None) -> BentTubes:
        """
        Return these tubes, linearised about another state of the frame.

        :param before: the other state; None: the state without loads.
        """
        found = replace(self, before=before)
        found.__dict__['_cut'] = self._cut
        return found

    def bent_like(self, others: BentTubes) -> BentTubes:
        """
        Return these tubes, linearised about a state taken from the tubes of a similar robot.

        :param others: tubes of the similar robot.
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

    @cached_property
    def ahead(self) -> Array:
        """Return (k,) 1 for load points on pieces that run along their member, else -1."""
        return self._cut[1]

    @cached_property
    def cuts(self) -> Array:
        """Return `places` (k,), shifted so that no part of a member is too short [m]."""
        return self._cut[2]

    @property
    def is_straight(self) -> bool:
        """Return whether the tubes are linearised about the state without loads."""
        return self.before is None

    @cached_property
    def frame(self) -> Frame:
        """Return the structure's frame with additional nodes at the load points."""
        return self._cut[0]

    def locate(self, members: Indices, places: Array) -> tuple[Indices, Array, Array]:
        """
        Return the parts of members that contain given points, see `Structure.locate`.

        :param members: (c,) indices of the members.
        :param places: (c,) distances from the members' starts [m].
        """
        piece, within, ahead = self.structure.locate(members, places)
        return *self.frame.locate(piece, within), ahead

    @cached_property
    def share(self) -> float:
        """
        Return the factor on the loads of the frame: 1, or almost 0 for the paper's model.

        Under loads scaled by almost 0 the frame is linear. Results are divided by the factor.
        """
        return NEGLIGIBLE_SHARE if self.linear else 1.0

    @cached_property
    def tangent(self) -> Tangent:
        """
        Return the frame linearised about the state `before`.

        :raises StructureError: the structure is a mechanism.
        """
        if self.before is None:
            return self.frame.rest
        displacements, multipliers, _, pull = self.before
        return self.frame.tangent(displacements, multipliers, pull)

    @cached_property
    def _units(self) -> Array:
        """Return the unit loads at the load points as loads (3 n, 3 k) on the nodes."""
        frame, count = self.frame, len(self.members)
        found = np.zeros((len(frame.points), 3, count, 3))
        x, y = self.axis.real, self.axis.imag
        own, ones = np.arange(count), np.ones(count)
        turns = np.array([[x, -y, 0.0 * x], [y, x, 0.0 * x], [0.0 * x, 0.0 * x, ones]])
        found[frame.nodes, :, own] = turns.transpose(2, 0, 1)
        return found.reshape(-1, 3 * count) * (self.share / self.stiffness)

    @cached_property
    def _changes(self) -> tuple[Array, Array]:
        """
        Return p changes of the displacements (n, 3, p) and of the multipliers (q, p).

        The causes of these changes are 3 k unit loads at the load points, k unit motions of the
        load points, and in the last column the step to equilibrium.
        """
        units = self._units
        loads = np.column_stack([units, -self._place_rates[0]])
        applied = np.zeros(len(units))
        if self.before is not None:
            applied = units @ self.before.loads.ravel()
        return self.tangent.balance(applied, loads)

    @property
    def _moving(self) -> slice:
        """Return the columns of `_changes` that belong to the motions of the load points."""
        count = len(self.members)
        return slice(3 * count, 4 * count)

    @cached_property
    def _place_rates(self) -> tuple[Array, Array, Array]:
        """
        Return the derivatives of loads, inclinations and forces with respect to `places`.

        :return: derivatives at fixed nodes: of the loads that the members carry (3 n, k), of the
            inclinations at the load points (k, k), and of the forces of the parts before and
            behind the load points (2 k, 3).
        """
        frame, tangent, count = self.frame, self.tangent, len(self.members)
        carried, inclined = np.zeros((len(frame.points) * 3, count)), np.zeros((count, count))
        if self.before is None:
            return carried, inclined, np.zeros((2 * count, 3))
        parts, _ = self._parts
        # If a place moves, the part before it becomes longer and the part behind it shorter.
        ways = np.append(self._cut[1], -self._cut[1])[:, None, None]
        by_length = tangent.length_rates[parts][..., None]
        rates = by_length * ways
        forces, own = tangent.nodal_forces(parts, rates)[..., 0], np.arange(count)[:, None]
        carried[frame.places[frame.before], own] = forces[:count]
        carried[frame.places[frame.behind], own] += forces[count:]
        # The length of a part between two places of one member depends on both places.
        longer = (parts[:, None] == frame.before) * self._cut[1]
        longer -= (parts[:, None] == frame.behind) * self._cut[1]
        changes = by_length * longer[:, None]
        inclined = self._mean((self._slopes.by_forces[:, None] @ changes)[:, 0])
        return carried, inclined, rates[..., 0]

    @cached_property
    def _parts(self) -> tuple[Indices, Indices]:
        """Return the parts before, then behind the load points (2 k,), and which end is there."""
        count = len(self.members)
        return np.append(self.frame.before, self.frame.behind), np.repeat([2, 1], count)

    @cached_property
    def _slopes(self) -> Slopes:
        """Return the tube's inclinations before and behind each load point."""
        return self.tangent.slopes(*self._parts)

    def _mean(self, sides: Array) -> Array:
        """Return the mean (k, ...) of values (2 k, ...) before and behind each load point."""
        count = len(self.members)
        return 0.5 * (sides[:count] + sides[count:])

    @cached_property
    def _rows(self) -> tuple[Array, Array]:
        """Return the responses (k, 3) in the linearised state, and their p changes."""
        frame, tangent, back = self.frame, self.tangent, self.axis.conj()
        moved, _ = self._changes
        own = tangent.displacements[frame.nodes]
        there = (own[:, 0] + 1j * own[:, 1]) * back
        nodes = moved[frame.nodes]
        along = (nodes[:, 0] + 1j * nodes[:, 1]) * back[:, None]
        slope = self._mean(self._slopes.values)
        inclined = self.inclination_changes(moved)
        return (
            np.stack([there.real, there.imag, slope], axis=1),
            np.stack([along.real, along.imag, inclined], axis=1),
        )

    @cached_property
    def matrix(self) -> Array:
        """Return the compliance (k, 3, k, 3): responses at the load points to unit loads."""
        count = len(self.members)
        return (self._rows[1][:, :, : 3 * count] / self.share).reshape(count, 3, count, 3)

    @cached_property
    def rates(self) -> Array:
        """
        Return the derivatives (k, 3, k) of the responses with respect to the places.

        The responses are the displacements [m] and inclinations [rad] at the load points; `places`
        are in metres.
        """
        count = len(self.members)
        found = self._rows[1][..., self._moving].copy()
        own = np.arange(count)
        found[:, 2] += self._place_rates[1]
        if self.before is not None:
            # The displacement is relative to the place, which moves along its member.
            found[own, 0, own] -= 1.0
            return found / self.share
        return np.zeros_like(found)

    @cached_property
    def given(self) -> Array:
        """Return the responses (k, 3), extrapolated to zero loads and zero places."""
        state, changes = self._rows
        found = (state + changes[..., -1]) / self.share
        if self.before is not None:
            found -= np.einsum('iajb,jb->ia', self.matrix, self.before.loads)
        return found - self.rates @ self._cut[2]

    def respond(self, loads: Array, places: Array) -> Array:
        """
        Return the displacements and inclinations (k, 3) at the load points, see `BentTubes`.

        They are affine functions of loads and places.

        :param loads: (k, 3) forces along and across the members [N], and moments [N m].
        :param places: (k,) distances of the load points from the members' starts [m].
        """
        moved = np.einsum('iajb,jb->ia', self.matrix, loads)
        return self.given + moved + self.rates @ places

    def distance(self, loads: Array, places: Array) -> float:
        """
        Return the largest displacement of a node from the linearised state due to loads [m].

        :param loads: (k, 3) loads at the load points.
        :param places: (k,) distances of the load points from the members' starts [m].
        """
        if (self.cuts != self.places).any():  # the nodes stay beside a node or another load point
            places = self._locate_cuts(places)[-1]
        ways = self._ways(loads, places)
        moved = np.abs(self._displace(ways)[0][:, :2]).max() / self.share
        # The state is less nonlinear in the places than in the displacements.
        slid = PLACE_SHARE * np.abs(ways[self._moving]).max()
        return float(max(moved, slid))

    def _displace(self, ways: Array) -> tuple[Array, Array]:
        """Return the changes by `ways` of the nodes' displacements (n, 3) and positions (n, 3)."""
        nodes = self._changes[0] @ ways
        moved = nodes.copy()
        if self.before is not None:
            # The displacement is relative to the place, which moves along its member.
            slid = self.axis * ways[self._moving]
            moved[self.frame.nodes, :2] -= np.column_stack([slid.real, slid.imag])
        return moved, nodes

    def _ways(self, loads: Array, places: Array) -> Array:
        """Return `ways` (p,), factors on the columns of `_changes`: loads, places, and 1."""
        known = 0.0 if self.before is None else self.before.loads
        return np.concatenate([(loads - known).ravel(), places - self._cut[2], [1.0]])

    def displace(self, loads: Array, places: Array) -> Displaced:
        """
        Return the linear prediction of the state of the frame.

        :param loads: (k, 3) loads at the load points.
        :param places: (k,) distances of the load points from the members' starts [m].
        """
        ways, tangent = self._ways(loads, places), self.tangent
        moved, nodes = self._displace(ways)
        displacements = tangent.displacements + moved
        multipliers = tangent.multipliers + self._changes[1] @ ways
        pull = tangent.forces.values[:, 0] + self._force_changes(ways, nodes)[0][:, 0]
        return Displaced(displacements, multipliers, loads, pull)

    def update(self, loads: Array, places: Array, structure: Structure | None = None) -> BentTubes:
        """
        Return the tubes linearised about the state that this linearisation predicts under loads.

        :param loads: (k, 3) loads at the load points.
        :param places: (k,) distances of the load points from the members' starts [m].
        :param structure: new structural model of the robot; None: unchanged.
        """
        found = replace(self, structure=structure or self.structure, places=places, before=None)
        parts = self.frame.length[self._parts[0]].reshape(2, -1).min(axis=0)
        # A node that moves by more than half of a part is interpolated on the bent member, because
        # the error of its extrapolation would turn the part.
        if (np.abs(found.cuts - self.cuts) <= 0.5 * parts).all():
            return found.bent_to(self.displace(loads, found.cuts))
        known = self.bent_to(self.displace(loads, self.cuts))
        return found.bent_to(found.bent_like(known).before._replace(loads=loads))

    def bend(self, loads: Array, places: Array) -> BentTubes:
        """
        Return the tubes linearised about their equilibrium under loads.

        :param loads: (k, 3) loads at the load points.
        :param places: (k,) distances of the load points from the members' starts [m].
        :raises StructureError: no equilibrium is found.
        """
        bent = self
        for _ in range(MAX_SEARCH_STEPS):
            if bent.distance(loads, places) <= ROUNDING:
                return bent
            bent = bent.update(loads, places)
        raise StructureError(
            f'no equilibrium of the bent tubes was found in {MAX_SEARCH_STEPS} steps: '
            'the loads must be smaller'
        )

    def changes(self, loads: Array, places: Array) -> tuple[Array, PlaceChanges]:
        """
        Return the frame's changes due to additional loads and to motion of the load points.

        Each of the p columns is one change.

        :param loads: (k, 3, p) additional loads at the load points.
        :param places: (k, p) motion of the load points along the members [m].
        :return: (n, 3, p) displacements of the nodes due to the loads, and the changes due to the
            motion of the load points.
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
        Return the changes (k, p) of the tubes' inclinations due to displaced nodes [rad].

        :param moved: (n, 3, p) displacements ux, uy [m], theta [rad].
        """
        ends = moved.reshape(-1, moved.shape[2])[self.frame.places[self._parts[0]]]
        return self._mean((self._slopes.by_ends @ ends)[:, 0])

    def node_changes(self, loads: Array) -> Array:
        """
        Return the displacements (n, 3, p) of the nodes due to additional loads [m, rad].

        :param loads: (k, 3, p) additional loads at the load points.
        """
        count = 3 * len(self.members)
        return self._changes[0][..., :count] @ loads.reshape(count, -1) / self.share

    def displacements(self, loads: Array, places: Array) -> Array:
        """
        Return the linear prediction of the nodes' displacements, (n, 3) [m, rad].

        :param loads: (k, 3) loads at the load points.
        :param places: (k,) distances of the load points from the members' starts [m].
        """
        return self.displace(loads, places).displacements / self.share

    def end_forces(self, loads: Array, places: Array) -> tuple[Array, Array]:
        """
        Return the linear prediction of the members' end forces.

        :param loads: (k, 3) loads at the load points.
        :param places: (k,) distances of the load points from the members' starts [m].
        :return: (c, 6) forces of the nodes on the members, see `FrameState.end_forces`, and (c,)
            axial forces, see `FrameState.bowing`.
        """
        tangent, ways = self.tangent, self._ways(loads, places)
        changes, longer = self._force_changes(ways, self._displace(ways)[1])
        forces = tangent.forces.values + changes
        ends, pull = end_forces(forces, tangent.length + longer), forces[:, 0]
        return self.stiffness / self.share * ends, 0.0 * pull if self.linear else pull

    def _force_changes(self, ways: Array, nodes: Array) -> tuple[Array, Array]:
        """Return the changes of `EndForces.values` (c, 3) and chord lengths (c,) by `ways`."""
        changes, longer = self.tangent.force_changes(nodes[..., None])
        changes, slid = changes[..., 0], np.tile(ways[self._moving], 2)
        np.add.at(changes, self._parts[0], self._place_rates[2] * slid[:, None])
        return changes, longer[:, 0]

    def section_changes(self, changes: Array) -> tuple[Array, Array, Array]:
        """
        Return the frame's changes for p changes of sections; loads and load points are constant.

        In the paper's model, the results are those under loads times `NEGLIGIBLE_SHARE`.

        :param changes: (4, c, p) changes of rest lengths [m], EA [N], EI [N m^2] and GA [N].
        :return: (n, 3, p) displacements of the nodes; (k, p) changes of the inclinations at the
            load points; and (c, 3, p) changes of the members' N, M1 and M2 with fixed nodes.
        """
        frame, tangent = self.frame, self.tangent
        every = np.arange(len(frame.length))
        units = np.broadcast_to(np.eye(4)[:, None], (4, len(every), 4))
        rates = np.einsum('cfi,icp->cfp', tangent.force_rates(every, units), changes)
        carried = np.zeros((3 * len(frame.points), changes.shape[2]))
        np.subtract.at(carried, frame.places, tangent.nodal_forces(every, rates))
        moved, _ = tangent.respond(carried)
        moved, (parts, _) = moved.reshape(-1, 3, changes.shape[2]), self._parts
        _, _, by_forces, by_shear = self._slopes
        shear = (by_shear / frame.section[2, parts])[:, None] * changes[3, parts]
        inclined = self._mean((by_forces[:, None] @ rates[parts])[:, 0] + shear)
        return moved, inclined + self.inclination_changes(moved), rates
