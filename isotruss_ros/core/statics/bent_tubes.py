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
from isotruss_ros.core.statics.elimination import Elimination
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
    """State of a bent frame about which tubes are linearised."""

    displacements: Array  #: (n, 3) displacements ux, uy [m], theta [rad]
    multipliers: Array  #: (q,) Lagrange multipliers of the constraints
    loads: Array  #: (k, 3) loads at the load points, see `BentTubes` [N, N m]
    pull: Array  #: (c,) axial forces of the frame's members [N]

    @classmethod
    def of_values(cls, frame: Frame, values: Array) -> Displaced:
        """Return the state of a frame from all of its values in this order, (s,)."""
        nodes, loads = (3 * number for number in (len(frame.points), len(frame.nodes)))
        ends = np.cumsum([nodes, frame.rows.count, loads, len(frame.length)])
        if values.shape != (ends[-1],):
            raise StructureError(f'bent tubes with {values.size} values: must be {ends[-1]}')
        moved, multipliers, pushed, pull = np.split(values, ends[:-1])
        return cls(moved.reshape(-1, 3), multipliers, pushed.reshape(-1, 3), pull)

    @property
    def values(self) -> Array:
        """Return the numbers of the state as one array, (s,)."""
        return np.concatenate([part.ravel() for part in self])


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
        axis = (config.points[topology.c[topology.following[members]]] - start) / length
        turns = np.zeros((len(members), 3, 3))
        turns[:, 0, 0] = turns[:, 1, 1] = axis.real
        turns[:, 1, 0], turns[:, 0, 1], turns[:, 2, 2] = axis.imag, -axis.imag, 1.0
        return cls(start, axis, length, turns)


class Cuts(NamedTuple):
    """Frame with nodes at k load points."""

    frame: Frame
    ahead: Array  #: (k,) 1 for load points on pieces that run along their member, else -1
    places: Array  #: (k,) `BentTubes.places`, shifted so that no part is too short [m]


class Changes(NamedTuple):
    """
    Changes of a linearised frame with k load points by p unit loads or motions.

    The causes are 3 k unit loads at the load points, k unit motions of the load points, and in the
    last column the step to equilibrium.
    """

    nodes: Array  #: (n, 3, p) displacements of the nodes [m, rad]
    multipliers: Array  #: (q, p) Lagrange multipliers
    responses: Array  #: (k, 3, p) responses at the load points, see `BentTubes`
    state: Array  #: (k, 3) responses in the linearised state
    slopes: Slopes  #: inclinations of the tubes before, then behind the load points
    factored: Elimination  #: factorised matrix of the frame


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
    stiffness: float = 1.0  #: factor on the modelled stiffness [-]
    #: whether the model is the paper's linear one, with the equilibrium of the undeformed tubes
    linear: bool = False
    #: state about which the tubes are linearised; None: the state without loads
    before: Displaced | None = None
    given_lines: Lines | None = None  #: members of the load points, which saves time; or None
    #: frame with nodes at the load points, which saves time; or None
    given_cuts: Cuts | None = None

    @cached_property
    def lines(self) -> Lines:
        """Return the members of the load points."""
        return self.given_lines or Lines.of(self.structure, self.members)

    @property
    def start(self) -> Points:
        """Return the pinch point at the start of each load point's member, (k,) x + iy [m]."""
        return self.lines.start

    @property
    def length(self) -> Array:
        """Return the length of each load point's member, pinch to pinch, (k,) [m]."""
        return self.lines.length

    @property
    def axis(self) -> Points:
        """Return the unit vector from start to end of each load point's member, (k,) x + iy."""
        return self.lines.axis

    @cached_property
    def _cuts(self) -> Cuts:
        """Return the frame with nodes at the load points."""
        if self.given_cuts is not None:
            return self.given_cuts
        pieces, inside, ahead, places = self._locate_cuts(self.structure, self.places)
        return Cuts(CutFrame(self.structure.frame, pieces, inside), ahead, places)

    def _locate_cuts(
        self, structure: Structure, places: Array
    ) -> tuple[Indices, Array, Array, Array]:
        """Return the pieces of tubes, the cuts in them, `ahead` and `cuts` for load points."""
        pieces, within, ahead = structure.locate(self.members, places)
        inside = keep_apart(pieces, within, structure.frame.length[pieces])
        return pieces, inside, ahead, places + ahead * (inside - within)

    def _bent_to(self, before: Displaced) -> BentTubes:
        """Return these tubes, linearised about another state."""
        return replace(self, before=before, given_lines=self.lines, given_cuts=self._cuts)

    def bent_to(self, values: Array) -> BentTubes:
        """Return these tubes, linearised about the state with given `Displaced.values`."""
        return self._bent_to(Displaced.of_values(self.frame, values))

    def bent_like(self, others: BentTubes) -> BentTubes:
        """Return these tubes, linearised about a state taken from the tubes of a similar robot."""
        return self if others.before is None else self._bent_to(others._state_of(self.frame))

    def _state_of(self, frame: Frame) -> Displaced:
        """Return the state of a similar frame with other cuts, interpolated from `before`."""
        (displacements, multipliers, _, pull), known, whole = self.before, self.frame, frame.whole
        longer = (self.structure.frame.length / frame.uncut.length)[whole]
        inner, middles = longer * frame.begins, longer * (frame.begins + 0.5 * frame.length)
        cut = known.interpolate(displacements, whole[frame.behind], inner[frame.behind])
        part, _ = known.locate(whole, middles)
        nodes = displacements[: len(frame.uncut.points)]
        return Displaced(
            np.append(nodes, cut, axis=0), multipliers, np.zeros((len(cut), 3)), pull[part]
        )

    @property
    def ahead(self) -> Array:
        """Return (k,) 1 for load points on pieces that run along their member, else -1."""
        return self._cuts.ahead

    @property
    def cuts(self) -> Array:
        """Return `places` (k,), shifted so that no part of a member is too short [m]."""
        return self._cuts.places

    @property
    def frame(self) -> Frame:
        """Return the structure's frame with additional nodes at the load points."""
        return self._cuts.frame

    @property
    def share(self) -> float:
        """
        Return the factor on the loads of the frame: 1, or almost 0 for the paper's model.

        Under loads scaled by almost 0 the frame is linear. Results are divided by the factor.
        """
        return NEGLIGIBLE_SHARE if self.linear else 1.0

    @cached_property
    def tangent(self) -> Tangent:
        """Return the frame linearised about the state `before`."""
        if self.before is None:
            return self.frame.rest
        displacements, multipliers, _, pull = self.before
        return self.frame.tangent(displacements, multipliers, pull)

    @cached_property
    def _changes(self) -> Changes:
        """Return the frame's changes by unit loads, and by unit motions of the load points."""
        frame, tangent, layout = self.frame, self.tangent, self.frame.layout
        count, nodes, turns = len(self.members), frame.nodes[0], self.lines.turns
        own, cut, moving, size = np.arange(count), layout.cut, self._moving, 3 * nodes
        right = np.zeros((size + frame.rows.count, 4 * count + 1))
        local = np.zeros((len(layout.ends) * layout.width, right.shape[1]))
        columns = np.arange(3 * count).reshape(count, 1, 3)
        local[cut[:, :, None], columns] = turns * (self.share / self.stiffness)
        slopes, inclined = tangent.slopes(), np.zeros((count, count))
        if self.before is not None:
            by_length = tangent.length_rates[layout.beside]
            # If a place moves, the part before it becomes longer and the part behind it shorter.
            ways = layout.signs.reshape(2, -1) * self.ahead
            pushed = tangent.nodal_forces(layout.beside, by_length[..., None])[..., 0]
            pushed *= ways.reshape(-1, 1)
            along = moving.start + own[:, None]
            local[layout.sides[:count], along] = pushed[:count]
            local[layout.sides[count:], along] += pushed[count:]
            # The length of a part between two places of one member depends on both places.
            changed = (slopes.by_forces * by_length).sum(axis=1)[:, None]
            inclined = _mean(changed * layout.longer[layout.sided]) * self.ahead
            left = local[:, : 3 * count] @ self.before.loads.ravel()
            carried = tangent.carried
            left[cut] -= carried[size:].reshape(count, 3)
            local[:, -1] = left
            right[:size, -1], right[size:, -1] = -carried[:size], -tangent.constraints[1]
        factored, found, local = tangent.respond_locally(right, local)
        moved = np.concatenate([found[:size], local[cut.ravel()]])
        moved = moved.reshape(nodes + count, 3, -1)
        back = turns.swapaxes(1, 2)
        responses = back @ moved[nodes:]
        responses[:, 2] = _mean((slopes.by_ends @ local[layout.sides])[:, 0])
        responses[:, 2, moving] += inclined
        if self.before is not None:
            # The displacement is relative to the place, which moves along its member.
            responses[own, 0, moving.start + own] -= 1.0
        state = (back @ tangent.displacements[nodes:, :, None])[..., 0]
        state[:, 2] = _mean(slopes.values)
        responded = moved, found[size:], responses, state
        return Changes(*responded, slopes, factored)

    @property
    def _moving(self) -> slice:
        """Return the columns of `_changes` that belong to the motions of the load points."""
        count = len(self.members)
        return slice(3 * count, 4 * count)

    @cached_property
    def matrix(self) -> Array:
        """Return the compliance (k, 3, k, 3): responses at the load points to unit loads."""
        count = len(self.members)
        found = self._changes.responses[:, :, : 3 * count] / self.share
        return found.reshape(count, 3, count, 3)

    @cached_property
    def rates(self) -> Array:
        """
        Return the derivatives (k, 3, k) of the responses with respect to the places.

        The responses are the displacements [m] and inclinations [rad] at the load points; `places`
        are in metres.
        """
        return self._changes.responses[..., self._moving] / self.share

    @cached_property
    def given(self) -> Array:
        """Return the responses (k, 3), extrapolated to zero loads and zero places."""
        none = np.zeros((len(self.members), 3))
        return self.respond(none, none[:, 0])

    def respond(self, loads: Array, places: Array) -> Array:
        """
        Return the displacements and inclinations (k, 3) at the load points, see `BentTubes`.

        They are affine functions of loads and places.
        """
        changes = self._changes
        return (changes.state + changes.responses @ self._ways(loads, places)) / self.share

    def distance(self, loads: Array, places: Array) -> float:
        """Return the largest displacement of a node from the linearised state due to loads [m]."""
        if (self.cuts != self.places).any():  # the nodes stay beside a node or another load point
            places = self._locate_cuts(self.structure, places)[-1]
        ways = self._ways(loads, places)
        moved = np.abs(self._displace(ways)[0][:, :2]).max() / self.share
        # The state is less nonlinear in the places than in the displacements.
        slid = PLACE_SHARE * np.abs(ways[self._moving]).max()
        return float(max(moved, slid))

    def _displace(self, ways: Array) -> tuple[Array, Array]:
        """Return the changes by `ways` of the nodes' displacements (n, 3) and positions (n, 3)."""
        nodes = self._changes.nodes @ ways
        if self.before is None:
            return nodes, nodes
        moved = nodes.copy()
        # The displacement is relative to the place, which moves along its member.
        slid = self.axis * ways[self._moving]
        moved[self.frame.nodes, 0] -= slid.real
        moved[self.frame.nodes, 1] -= slid.imag
        return moved, nodes

    def _ways(self, loads: Array, places: Array) -> Array:
        """Return `ways` (p,), factors on the columns of `_changes`: loads, places, and 1."""
        known = 0.0 if self.before is None else self.before.loads
        return np.concatenate([(loads - known).ravel(), places - self.cuts, [1.0]])

    def displace(self, loads: Array, places: Array) -> Displaced:
        """Return the linear prediction of the state of the frame."""
        ways, tangent = self._ways(loads, places), self.tangent
        moved, nodes = self._displace(ways)
        displacements = tangent.displacements + moved
        multipliers = tangent.multipliers + self._changes.multipliers @ ways
        pull = tangent.forces.values[:, 0] + self._force_changes(ways, nodes)[0][:, 0]
        return Displaced(displacements, multipliers, loads, pull)

    def update(self, loads: Array, places: Array, structure: Structure | None = None) -> BentTubes:
        """Return the tubes linearised about the state that these predict under loads."""
        structure = self.structure if structure is None else structure
        pieces, inside, ahead, cuts = self._locate_cuts(structure, places)
        frame = CutFrame(structure.frame, pieces, inside, self.frame)
        # A node that moves by more than half of a part is interpolated on the bent member, because
        # the error of its extrapolation would turn the part.
        half = 0.5 * self.frame.length[self.frame.layout.beside].reshape(2, -1)
        if (np.abs(cuts - self.cuts) <= half).all():
            before = self.displace(loads, cuts)
        else:
            known = self._bent_to(self.displace(loads, self.cuts))
            before = known._state_of(frame)._replace(loads=loads)
        lines, given = self.lines if structure is self.structure else None, self.stiffness
        cuts = Cuts(frame, ahead, cuts)
        return BentTubes(structure, self.members, places, given, self.linear, before, lines, cuts)

    def bend(self, loads: Array, places: Array) -> BentTubes:
        """Return the tubes linearised about their equilibrium under loads."""
        bent = self
        for _ in range(MAX_SEARCH_STEPS):
            if bent.distance(loads, places) <= ROUNDING:
                return bent
            bent = bent.update(loads, places)
        raise StructureError(
            f'no equilibrium of the bent tubes was found in {MAX_SEARCH_STEPS} steps: '
            'the loads must be smaller'
        )

    def changes(self, loads: Array, places: Array) -> tuple[Array, Array, Array]:
        """
        Return the frame's changes by additional loads (k, 3, p) and motions (k, p) of the places.

        :return: (n, 3, p) displacements of the nodes [m, rad]; (k, p) changes of the inclinations
            [rad]; and (c, 3, p) those of the members' forces with fixed nodes, see `EndForces`.
        """
        changes, parts = self._changes, self.frame.layout.parts
        ways = np.concatenate([loads.reshape(-1, loads.shape[2]), places])
        forces = np.zeros((len(self.frame.length), 3, places.shape[1]))
        forces[parts] = self.tangent.length_rates[parts, :, None] * self._longer(places)[:, None]
        return changes.nodes[..., :-1] @ ways, changes.responses[:, 2, :-1] @ ways, forces

    def inclination_changes(self, moved: Array) -> Array:
        """Return the changes (k, p) of the tubes' inclinations due to displaced nodes [rad]."""
        ends = moved.reshape(-1, moved.shape[2])[self.frame.places[self.frame.layout.beside]]
        return _mean((self._changes.slopes.by_ends @ ends)[:, 0])

    def node_changes(self, loads: Array) -> Array:
        """Return the displacements (n, 3, p) of the nodes due to additional loads [m, rad]."""
        count = 3 * len(self.members)
        return self._changes.nodes[..., :count] @ loads.reshape(count, -1) / self.share

    def displacements(self, loads: Array, places: Array) -> Array:
        """Return the linear prediction of the nodes' displacements, (n, 3) [m, rad]."""
        moved, _ = self._displace(self._ways(loads, places))
        return (self.tangent.displacements + moved) / self.share

    def end_forces(self, loads: Array, places: Array) -> tuple[Array, Array]:
        """Return the linear prediction of the members' end forces."""
        tangent, ways = self.tangent, self._ways(loads, places)
        changes, longer = self._force_changes(ways, self._displace(ways)[1])
        forces = tangent.forces.values + changes
        ends, pull = end_forces(forces, tangent.length + longer), forces[:, 0]
        return self.stiffness / self.share * ends, 0.0 * pull if self.linear else pull

    def _force_changes(self, ways: Array, nodes: Array) -> tuple[Array, Array]:
        """Return the changes of `EndForces.values` (c, 3) and chord lengths (c,) by `ways`."""
        changes, longer = self.tangent.force_changes(nodes[..., None])
        changes, parts = changes[..., 0], self.frame.layout.parts
        if self.before is not None:
            lengthened = self._longer(ways[self._moving, None])
            changes[parts] += self.tangent.length_rates[parts] * lengthened
        return changes, longer[:, 0]

    def _longer(self, places: Array) -> Array:
        """Return the changes (c, p) of the parts' rest lengths by motions (k, p) of cuts [m]."""
        return self.frame.layout.longer @ (self.ahead[:, None] * places)

    def section_changes(self, changes: Array) -> tuple[Array, Array, Array]:
        """
        Return the frame's changes for p changes of sections; loads and load points are constant.

        In the paper's model, the results are those under loads times `NEGLIGIBLE_SHARE`.
        """
        frame, tangent, parts = self.frame, self.tangent, self.frame.layout.beside
        count, chosen = changes.shape[2], np.flatnonzero(changes.any(axis=(0, 2)))
        units = np.broadcast_to(np.eye(4)[:, None], (4, len(chosen), 4))
        rates = np.zeros((len(frame.length), 3, count))
        rates[chosen] = tangent.force_rates(chosen, units) @ changes[:, chosen].swapaxes(0, 1)
        pushed = tangent.nodal_forces(chosen, rates[chosen])
        places = frame.places[chosen, :, None] * count + np.arange(count)
        carried = np.bincount(places.ravel(), pushed.ravel(), 3 * len(frame.points) * count)
        moved, _ = tangent.respond(-carried.reshape(-1, count), factored=self._changes.factored)
        moved = moved.reshape(-1, 3, count)
        _, _, by_forces, by_shear = self._changes.slopes
        shear = (by_shear / frame.section[2, parts])[:, None] * changes[3, parts]
        inclined = _mean((by_forces[:, None] @ rates[parts])[:, 0] + shear)
        return moved, inclined + self.inclination_changes(moved), rates


def _mean(sides: Array) -> Array:
    """Return the mean (k, ...) of values (2 k, ...) before and behind each load point."""
    count = len(sides) // 2
    return 0.5 * (sides[:count] + sides[count:])
