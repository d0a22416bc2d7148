# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Equations of equilibrium of a convex object with friction on the tubes.

The object has k contacts on two or three members:

    X_i = P_i + s_i e_i + u_i,  u = u_0 + C f + D s                     deformed point of contact
    X_i = c + R(theta) p(nu_i) + rho_i nu_i                             touch
    w = sum f_i,  m = sum of arms x f_i,  f_i = (N_i + i T_i) nu_i      balance

with the member's start P_i and direction e_i, the displacement u_i of the tube, the compliances C
and D for loads f and positions s, the object's pose (c, theta), the surface point p(nu) whose
normal is nu, and the distance rho_i of this point from the centre line. A beam bends
away from the object, so a polygon touches it at corners or at both ends of a face. The unknowns
are the object's pose, the positions of the contacts along the members, the inclinations of the
bent tubes at the contacts, and the contact forces. The equations state that object and member
touch (along the member, across it, and in inclination), that the object is in balance, and k
conditions of friction or rolling.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable
from dataclasses import dataclass, replace
import functools
from typing import NamedTuple

from isotruss_ros.core.contact.dents import dent_table, Dents
from isotruss_ros.core.contact.flattening import flattening_of
from isotruss_ros.core.holding.pressed_contacts import (
    ANGLE,
    CENTER,
    ContactForces,
    Places,
    POSE,
    PressedContacts,
)
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject, facing_normals
from isotruss_ros.core.model.shapes import PLANNED_DEPTH, Shape
from isotruss_ros.core.numerics.arrays import Array, MAX_LOAD, Points
from isotruss_ros.core.numerics.tolerances import MAX_NEWTON_ITERATIONS, ROUNDING
from isotruss_ros.core.numerics.work_limit import count_work
from isotruss_ros.core.statics.bent_tubes import BentTubes, FOLLOWED_MOTION, Lines, SETTLED_MOTION
from isotruss_ros.core.statics.section import Pressure
from isotruss_ros.core.statics.structure import Structure, structure_of
import numpy as np
from scipy.linalg import lapack

#: Tolerances of the balance, relative to the sum of normal forces [-], and of the gaps [m].
FORCE_TOLERANCE, LENGTH_TOLERANCE = 1e-10, 1e-11
#: Largest rotation in a Newton step [rad], and largest translation in a Newton step, divided by
#: the characteristic radius [-].
MAX_TURN = 0.2
#: Largest inclination of a tube in equilibrium [rad]; a tube with a larger inclination folds.
MAX_INCLINATION = 0.5
#: Largest motion of a contact across a guide ring, for which the tubes may be linearised at the
#: ring, in tube radii [-]. With a third of it, 400 random grasps have the same equilibria; with
#: three times of it, one that is far from the start is not found.
RING_REACH = 0.1
#: Compliance that scales friction forces to lengths, so that one tolerance bounds both [m/N].
FRICTION_COMPLIANCE = 1e-4
#: Conditions of friction or rolling: residual (k,), and its derivatives (k, 3 + 4k) with respect
#: to the unknowns, as functions of unknowns and normals.
ContactConditions = Callable[[Array, Points], tuple[Array, Array]]


class Pushes(NamedTuple):
    """Loads of k contacts on the tubes."""

    member_normals: Points  #: (k,) normals in member axes, along + i across
    skin: Array  #: (k,) distance of the dented skin from the centre line [m]
    depth_by_force: Array  #: (k,) derivatives of the dents' depths by the normal forces [m/N]
    depth_by_angle: Array  #: (k,) derivatives of the dents' depths by the normals' angles [m/rad]
    member_forces: Points  #: (k,) forces on the tubes in member axes, along + i across [N]
    loads: Array  #: (k, 3) forces along and across [N] and moments [N m]
    #: (4, 3, k) derivatives of the loads with respect to inclination, normal and friction force,
    #: and angle of the object
    rates: Array

    def load_rates(self, change: Array) -> Array:
        """Return the changes (k, 3, c) of the loads for c changes of the unknowns."""
        count = len(self.skin)
        angle = np.repeat(change[None, None, ANGLE], count, axis=1)
        causes = np.concatenate([change[Places.of(count).causes].reshape(3, count, -1), angle])
        # Axes: cause l as in `rates`, component n of the load, contact k, change c.
        return np.einsum('lnk,lkc->knc', self.rates, causes)


@dataclass(frozen=True, eq=False)
class ContactStatics:
    """Equations of equilibrium of a convex object at k contacts."""

    bent: BentTubes  #: compliance of the bent tubes at the contacts
    body: ConvexObject  #: the object at its measured pose
    contacts: PressedContacts  #: the k contacts
    tube_radius: float  #: radius of the tubes [m]
    sides: Array  #: (k,) +1 if the object is on the right of the member, else -1
    dents: Dents  #: depths of the dents in the skin as functions of normal forces and normals

    @functools.cached_property
    def places(self) -> Places:
        """Return the indices of the unknowns and of the equations."""
        return Places.of(len(self.contacts.owners))

    @functools.cached_property
    def anchor_rates(self) -> Array:
        """Return the derivatives (k, r) of the rolling invariants by roller travel."""
        topology = self.bent.structure.config.robot.topology
        is_at_start = self.contacts.members[:, None] == topology.driven
        return self.sides[:, None] * is_at_start

    @property
    def straight_normals(self) -> Points:
        """Return the normals of the straight tubes, away from the object, (k,) x + iy."""
        return 1j * self.sides * self.bent.lines.axis

    def are_on_members(self, feet: Array) -> bool:
        """Return whether all contacts are between the ends of their members."""
        return bool(((feet >= 0.0) & (feet <= self.bent.lines.length)).all())

    def bent_under(self, unknowns: Array, structure: Structure | None = None) -> BentTubes:
        """Return the tubes linearised about their bent state at given unknowns."""
        return self.bent.update(self.pushes(unknowns).loads, unknowns[self.places.feet], structure)

    def pushes(self, unknowns: Array) -> Pushes:
        """Return the loads of the contacts on the tubes, with derivatives by the unknowns."""
        inclination, normal, friction = unknowns[self.places.causes].reshape(3, -1)
        # Vectors in member axes are complex numbers, along + i across.
        normals = 1j * self.sides * np.exp(1j * inclination)
        angles = object_angles(unknowns, self.bent.lines.axis * normals)
        depths, by_force, by_turn = self.dents(normal, angles)
        # Friction acts at the skin of a tube, so it exerts a moment about the centre line.
        skin = self.tube_radius - depths
        forces = (normal + 1j * friction) * normals
        loads = np.array([forces.real, forces.imag, -skin * friction]).T
        # Derivatives by the causes in `Pushes.rates`. If the object turns, only the dents change.
        force_rates = np.array([1j * forces, normals, 1j * normals, np.zeros_like(normals)])
        moment_rates = [by_turn * friction, by_force * friction, -skin, -by_turn * friction]
        rates = np.array([force_rates.real, force_rates.imag, moment_rates]).swapaxes(0, 1)
        return Pushes(normals, skin, by_force, by_turn, forces, loads, rates)

    def equations(
        self,
        unknowns: Array,
        wrench: Array,
        conditions: ContactConditions,
        pushes: Pushes | None = None,
    ) -> tuple[Array, ContactForces]:
        """Return the residual (3 + 4k,) of the equations, see `Places`, and the state."""
        indices, axis, arm = self.places, self.bent.lines.axis, self.body.arm
        count, moment_row = len(self.sides), indices.balance.stop - 1
        affine = slice(indices.balance.stop)
        residual = np.empty(indices.size)
        jacobian = np.zeros((indices.size, indices.size))

        # Contact points from the object's origin, in member axes. If the object turns while the
        # tube does not, the contact point moves back on the object's surface.
        turn = cmath.rect(1.0, unknowns[ANGLE])
        pushes = pushes or self.pushes(unknowns)
        normals = axis * pushes.member_normals
        in_object = normals * turn.conjugate()
        points, radii = self.body.shape.surface_at(self.contacts.corners, in_object)
        to_contacts = axis.conj() * turn * points
        contacts_by_angle = 1j * (to_contacts - radii * pushes.member_normals)

        # Touch and balance without the terms that do not depend on the loads.
        by_loads = np.zeros((affine.stop, count, 3))
        by_loads[:-3] = self.bent.compliance.matrix.reshape(3 * count, count, 3)
        # The forces on the object are opposite to those on the tubes.
        by_loads[-3:-1] = -self.bent.lines.turns[:, :2].swapaxes(0, 1)
        by_loads[-1, :, :2] = (-1j * to_contacts).view(np.float64).reshape(count, 2) / arm
        residual[affine] = by_loads.reshape(affine.stop, -1) @ pushes.loads.ravel()
        # Axes: equation r, cause n as in `Pushes.rates`, contact k, component c of its load.
        by_cause = np.einsum('rkc,nck->rnk', by_loads, pushes.rates)
        jacobian[affine, indices.causes] = by_cause[:, :3].reshape(affine.stop, -1)
        jacobian[affine, ANGLE] = by_cause[:, 3].sum(axis=1)

        # Touch: gaps between the object and the tubes.
        self._add_gaps(residual, jacobian, unknowns, pushes, to_contacts, contacts_by_angle, radii)

        # Balance: external wrench; the arms of the forces turn with the normals and the object.
        residual[indices.balance] += wrench
        jacobian[moment_row, indices.inclinations] += radii * unknowns[indices.normal] / arm
        moment_by_angle = -complex(np.vdot(contacts_by_angle, pushes.member_forces)).imag
        jacobian[moment_row, ANGLE] = moment_by_angle / arm

        residual[indices.conditions], jacobian[indices.conditions] = conditions(unknowns, normals)
        return residual, ContactForces(unknowns, normals, pushes.loads, jacobian)

    def _add_gaps(
        self,
        residual: Array,
        jacobian: Array,
        unknowns: Array,
        pushes: Pushes,
        to_contacts: Points,
        contacts_by_angle: Points,
        radii: Array,
    ) -> None:
        """Add the gaps between object and tubes, without loads, to the equations of touch."""
        indices, lines, compliance = self.places, self.bent.lines, self.bent.compliance
        count, feet = len(self.sides), unknowns[indices.feet]
        # Axes: contact, equation of touch (along, across, inclination), unknown.
        touch = residual[: 3 * count].reshape(count, 3)
        touch_rows = jacobian[: 3 * count].reshape(count, 3, -1)
        # Gaps (along + i across) at straight tubes, and displacements by the contacts' positions.
        center = complex(unknowns[0], unknowns[1])
        to_starts = lines.axis.conj() * (lines.start - center)
        gaps = to_starts - to_contacts + feet - pushes.skin * pushes.member_normals
        touch += compliance.constant + compliance.rates @ feet
        touch[:, :2] += gaps.view(np.float64).reshape(count, 2)
        touch[:, 2] -= unknowns[indices.inclinations]
        # Derivatives by the object's pose, and by the positions of the contacts.
        touch_rows[:, :2, CENTER] = -lines.turns[:, :2, :2].swapaxes(1, 2)
        dents_by_angle = pushes.depth_by_angle * pushes.member_normals
        gaps_by_angle = contacts_by_angle + dents_by_angle
        touch_rows[:, :2, ANGLE] -= gaps_by_angle.view(np.float64).reshape(count, 2)
        touch_rows[:, 0, indices.feet] = np.eye(count)
        touch_rows[:, :, indices.feet] += compliance.rates
        # Derivatives by the inclination and the normal force of the same contact. Axes: contact k,
        # equation a of touch, and kind n of unknown: position, inclination, normal, friction.
        by_kind = touch_rows[:, :, POSE:].reshape(count, 3, 4, count)
        at_same_contact = np.einsum('kank->kan', by_kind)
        by_inclination = dents_by_angle - 1j * (radii + pushes.skin) * pushes.member_normals
        gap_rates = np.array([by_inclination, pushes.depth_by_force * pushes.member_normals]).T
        at_same_contact[:, 0, 1:3] += gap_rates.real
        at_same_contact[:, 1, 1:3] += gap_rates.imag
        at_same_contact[:, 2, 1] -= 1.0

    def rolling_rows(self, unknowns: Array, normals: Points) -> Array:
        """Return the derivatives (k, 3 + 4k) of the rolling invariants by the unknowns."""
        indices, contacts = self.places, np.arange(len(normals))
        in_object = normals * np.exp(-1j * unknowns[ANGLE])
        _, radii = self.body.shape.surface_at(self.contacts.corners, in_object)
        derivative = np.zeros((len(contacts), indices.size))
        derivative[:, ANGLE] = radii
        derivative[contacts, indices.feet.start + contacts] = -self.sides
        derivative[contacts, indices.inclinations.start + contacts] = -radii
        return derivative

    def sticking(self, unknowns: Array, normals: Points) -> tuple[Array, Array]:
        """Return conditions of contacts that stick: zero residuals and `rolling_rows`."""
        return np.zeros(len(normals)), self.rolling_rows(unknowns, normals)

    def start(self) -> Array:
        """Return an initial guess of the unknowns (3 + 4k,) at the object's measured pose."""
        indices, bent, body = self.places, self.bent, self.body
        unknowns = np.zeros(indices.size)
        unknowns[:POSE] = body.center.real, body.center.imag, body.pose.angle
        unknowns[indices.feet] = bent.places
        in_object = self.straight_normals * body.turn.conjugate()
        points, _ = body.shape.surface_at(self.contacts.corners, in_object)
        from_start = body.center + body.turn * points - bent.lines.start
        heights = self.sides * (bent.lines.axis.conj() * from_start).imag
        depths = np.maximum(self.tube_radius + heights, PLANNED_DEPTH * self.tube_radius)
        # The depth is that of the tube's displacement across the member and of the dent. The
        # diagonal of the compliance (k, 3, k, 3) is each contact's response to its own load.
        tube_compliance = np.einsum('kaka->ka', bent.compliance.matrix)[:, 1]
        _, dent_compliance, _ = self.dents(depths / tube_compliance, np.angle(in_object))
        unknowns[indices.normal] = depths / (tube_compliance + dent_compliance)
        return unknowns

    def anchors(self, unknowns: Array, normals: Points, previous: Array) -> Array:
        """
        Return the rolling invariants (k,), which are constant while the contacts roll [m].

        A_i = kappa_i (s_i - phi_i) - arc(arg nu_i - theta), where s_i is the position along the
        member, phi_i the travel of the tube, arc the arc length along the object's surface, nu_i
        the normal and theta the object's angle; kappa_i is -1 if the object is on the right of the
        member, otherwise 1. For `previous` see `object_angles`.
        """
        angles = object_angles(unknowns, normals, previous)
        arcs = self.body.shape.unroll(angles, self.contacts.corners)
        rolled = self.anchor_rates @ self.bent.structure.config.roller_positions
        return rolled - self.sides * unknowns[self.places.feet] - arcs

    def settle(
        self,
        start: Array,
        wrench: Array,
        conditions: ContactConditions,
        steps: int = MAX_NEWTON_ITERATIONS,
        reach: float = SETTLED_MOTION,
    ) -> tuple[ContactStatics, ContactForces] | None:
        """
        Find the equilibrium by Newton's method; return its equations and state, or None.

        Tubes are linearised again if a node has moved by more than `reach` [m], and if the error
        is smaller than at the last time, so that the iteration does not alternate. If a contact
        crosses a guide ring and returns, they are linearised with this contact at the ring.
        """
        statics, unknowns, indices = self, start, self.places
        least_error, moves_by_rounding = np.inf, False
        crossings = np.zeros(len(self.sides))
        pushes = self.pushes(start)
        tolerance = np.full(indices.size, LENGTH_TOLERANCE)
        for _ in range(steps):
            count_work()
            residual, state = statics.equations(unknowns, wrench, conditions, pushes)
            squeeze = np.abs(unknowns[indices.normal]).sum()
            tolerance[indices.balance] = FORCE_TOLERANCE * squeeze
            # For NaN the comparisons are false, so NaN is not a solution.
            error = float((np.abs(residual) / tolerance).max())
            is_solved = error <= 1.0

            if not is_solved:
                next_unknowns = statics._advance(state, residual)
                if next_unknowns is None:
                    return None
                unknowns, pushes = next_unknowns, statics.pushes(next_unknowns)
                if not np.abs(pushes.loads).max() <= MAX_LOAD:
                    return None  # the iteration diverges

            # The end of the iteration. Tubes are not modelled beyond the ends of their members, so
            # contacts there converge slowly, and are accepted before.
            feet = unknowns[indices.feet]
            motion = statics.bent.distance(pushes.loads, feet)
            is_linearised = motion <= reach or moves_by_rounding
            is_beyond_end = motion <= FOLLOWED_MOTION and not statics.are_on_members(feet)
            if is_beyond_end or (is_solved and is_linearised):
                inclination = np.abs(unknowns[indices.inclinations]).max()
                return (statics, state) if inclination <= MAX_INCLINATION else None

            # The tubes are linearised again. In soft structures, nodes then move by rounding.
            if not is_linearised and (is_solved or error < least_error):
                moves_by_rounding, least_error = motion <= ROUNDING, error
                bent = statics.bent.update(pushes.loads, feet)
                is_near = np.abs(feet - statics.bent.places) < RING_REACH * self.tube_radius
                crossings += is_near & (bent.cuts.pieces != statics.bent.cuts.pieces)
                if (crossings > 1.0).any():
                    rings = bent.structure.nearest_rings(bent.members, feet)
                    feet = np.where(crossings > 1.0, rings, feet)
                    bent, crossings = statics.bent.update(pushes.loads, feet), 0.0 * crossings
                statics = replace(statics, bent=bent)
        return None

    def _advance(self, state: ContactForces, residual: Array) -> Array | None:
        """Return the unknowns after a bounded step of Newton's method; None if singular."""
        _, _, step, singular = lapack.dgesv(state.jacobian, -residual)
        limits = np.full(step.size, MAX_TURN * self.body.arm)
        limits[ANGLE] = limits[state.places.inclinations] = MAX_TURN
        limits[state.places.forces] = np.inf
        sizes = np.abs(step)
        # The motion of the centroid does not depend on the frame of the object.
        centroid = cmath.rect(1.0, state.unknowns[ANGLE]) * self.body.shape.centroid
        sizes[CENTER] = abs(complex(step[0], step[1]) + 1j * centroid * step[ANGLE])
        if singular or not sizes.max() < np.inf:
            return None
        return state.unknowns + step / max(1.0, float((sizes / limits).max()))


def object_angles(unknowns: Array, normals: Points, previous: Array | float = 0.0) -> Array:
    """Return the angles (k,) of normals in the object's frame, within pi of `previous` [rad]."""
    return previous + np.angle(normals * np.exp(-1j * (unknowns[ANGLE] + previous)))


def build_statics(
    config: Configuration,
    body: ConvexObject,
    contacts: PressedContacts,
    pressure: Pressure | None = None,
    stiffness: float = 1.0,
) -> ContactStatics:
    """Return the equilibrium equations of an object with given contacts, for straight tubes."""
    structure = structure_of(config, pressure, stiffness)
    lines = Lines.of(structure, contacts.members)
    normals = facing_normals(body.middle, lines.start, lines.axis)
    points, _ = body.shape.surface_at(contacts.corners, normals * body.turn.conjugate())
    feet = ((body.center + body.turn * points - lines.start) * lines.axis.conj()).real
    bent = BentTubes.of(structure, contacts.members, np.clip(feet, 0.0, lines.length))
    return statics_of(bent, body, contacts)


def statics_of(bent: BentTubes, body: ConvexObject, contacts: PressedContacts) -> ContactStatics:
    """Return the equilibrium equations of an object with given contacts on bent tubes."""
    normals = facing_normals(body.middle, bent.lines.start, bent.lines.axis)
    return ContactStatics(
        bent=bent,
        body=body,
        contacts=contacts,
        tube_radius=0.5 * bent.structure.config.robot.description.tube_diameter,
        sides=np.sign((normals * bent.lines.axis.conj()).imag),
        dents=find_dents(bent.structure, body.shape, contacts),
    )


def find_dents(structure: Structure, shape: Shape, contacts: PressedContacts) -> Dents:
    """Return the dents at all contacts, as functions of normal forces and angles."""
    robot = structure.config.robot
    tubes = robot.topology.tube[contacts.members].tolist()
    tables = [
        dent_table(flattening_of(robot, structure.pressures[tube]), shape, corner)
        for tube, corner in zip(tubes, contacts.corners.tolist(), strict=True)
    ]
    return Dents(tables)
