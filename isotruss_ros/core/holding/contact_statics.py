# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The equilibrium of a convex object at several contacts, friction loading the tubes as well.

Of any shape, at k contacts on two members or three:

    X_i = P_i + s_i e_i + u_i,  u = C f,  f_i = (N_i + i T_i) nu_i      deformed point of contact
    X_i = c + R(theta) p(nu_i) + rho_i nu_i                             touch
    w = sum f_i,  m = sum of arms x f_i                                 balance

with p(nu) the point of the surface whose normal is nu, and rho_i from there to the centre line.
A beam bends away from what presses on it: of a polygon it touches corners, and a face that lies on
it with both of its ends. Unknowns are the object's pose, where along the members the contacts are,
how the bent tubes are inclined there, and the contact forces. Rows are touch along and across the
members, inclination, balance, and the k rows of a closure, of friction or of rolling, that statics
leaves open.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable
from dataclasses import dataclass
import functools
import math
from typing import NamedTuple

from isotruss_ros.core.contact.dents import Indentation
from isotruss_ros.core.holding.contact_forces import ANGLE, ContactForces, Places, POSE
from isotruss_ros.core.holding.pressed_contacts import PressedContacts
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.statics.member_compliance import MemberCompliance
from isotruss_ros.core.statics.section import Pressure
import numpy as np
from scipy.linalg import lapack

#: Forces balance to this share of the squeeze, contact points touch to this length [m].
FORCE_TOLERANCE, LENGTH_TOLERANCE = 1e-10, 1e-11
MAX_STEPS = 40
#: In one step contacts and object move at most this share of the object's size ...
MAX_MOVE = 0.5
#: ... and tubes incline at most by this [rad]. A tube that inclines by more than the other has
#: folded long before: there the linear structure has balances that mean nothing.
MAX_TURN, MAX_INCLINATION = 0.2, 0.5
#: What turns forces into lengths, so that one tolerance serves both [m/N].
SOFTNESS = 1e-4
#: Rows that settle what statics leaves open: residual (k,) and derivative (k, 3 + 4k) in a state.
Closure = Callable[[Array, Points], tuple[Array, Array]]


class TubeModel(NamedTuple):
    """
    What is assumed of the tubes that hold an object.

    :ivar stiffness_scale: stiffness of the robot against that of the model.
    :ivar flattening: whether the tubes' sections flatten where they are touched.
    :ivar pressure: gauge [Pa], see `tube_pressures`; that of the robot file if None.
    """

    stiffness_scale: float = 1.0
    flattening: bool = True
    pressure: Pressure | None = None


@dataclass(frozen=True, eq=False)
class ContactStatics:
    """
    The equations of a convex object at k contacts.

    :ivar compliance: of the structure on the members of the contacts.
    :ivar body: the object, near where it is.
    :ivar contacts: the k contacts.
    :ivar tube_radius: [m].
    :ivar sides: (k,) +1 where the object is on the right of the member (seen along its axis from
        its start), -1 on the left.
    :ivar indentation: depths (k,) of the dents in the skin [m] for normal forces (k,) [N], and
        their derivatives [m/N].
    :ivar given: (k, 3) what loads elsewhere move the members by at the contacts, along and across
        [m], and incline them by [-]; one number for all.
    """

    compliance: MemberCompliance
    body: ConvexObject
    contacts: PressedContacts
    tube_radius: float
    sides: Array
    indentation: Indentation
    given: Array | float = 0.0

    @functools.cached_property
    def places(self) -> Places:
        """Return where what is among the unknowns."""
        return Places.of(len(self.contacts.owners))

    @property
    def straight_normals(self) -> Points:
        """Return the normals of the tubes as long as they are straight, from the object (k,)."""
        return 1j * self.sides * self.compliance.axis

    def loads(self, unknowns: Array) -> Array:
        """
        Return forces along and across the members [N] and moments [N m] of the contacts, (k, 3).

        :param unknowns: see `ContactForces`.
        """
        begin = self.places.normal.start
        return self.loads_of(unknowns, unknowns[begin:, None])[..., 0]

    def loads_of(self, unknowns: Array, forces: Array) -> Array:
        """
        Return the same of c cases of other forces, where and along which those act, (k, 3, c).

        :param unknowns: see `ContactForces`.
        :param forces: (2k, c) normal, then friction [N].
        """
        places = self.places
        normal, friction = np.split(forces, 2)
        local = 1j * self.sides * np.exp(1j * unknowns[places.inclinations])
        force = (normal + 1j * friction) * local[:, None]
        # Friction acts at the skin of a tube, so that it turns the tube as well.
        skin = self.tube_radius - self.indentation(unknowns[places.normal])[0]
        return np.stack([force.real, force.imag, -skin[:, None] * friction], axis=1)

    def equations(
        self, unknowns: Array, wrench: Array, closure: Closure
    ) -> tuple[Array, Array, Points]:
        """
        Return residual (3 + 4k,), its Jacobian and normals (k,).

        :param unknowns: see `ContactForces`.
        :param wrench: (fx, fy, m / arm) on the object [N].
        :param closure: the remaining equations, of friction or of rolling.
        """
        places, count = self.places, len(self.sides)
        center, turn = complex(unknowns[0], unknowns[1]), cmath.rect(1.0, unknowns[ANGLE])
        feet, turned, normal, friction = unknowns[POSE:].reshape(4, count)
        local = 1j * self.sides * np.exp(1j * turned)  # normals along and across the members
        normals = self.compliance.axis * local
        points, radii = self.body.shape.surface_at(
            self.contacts.corners, normals * turn.conjugate()
        )
        depths, softs = self.indentation(normal)
        gaps, loads, touch, pushes, balance = [], [], [], [], []
        total, turning, swing, unit = 0j, 0.0, 0.0, self.body.arm
        # Single numbers of Python are several times quicker than arrays over a few contacts.
        of_tubes = self.compliance.axis, self.compliance.start, local, turned, depths, softs
        of_contacts = *of_tubes, points, radii, feet, normal, friction
        for axis, start, own, bent, depth, soft, point, radius, foot, presses, rubs in zip(
            *(values.tolist() for values in of_contacts), strict=True
        ):
            arm, skin, force = turn * point, self.tube_radius - depth, complex(presses, rubs) * own
            back, lever, slope = axis.conjugate(), arm.conjugate() / unit, math.tan(bent)
            total, turning = total + axis * force, turning + (lever * axis * force).imag
            gap = back * (start - center - arm) + foot - skin * own
            gaps.append((gap.real, gap.imag, -slope))
            loads.append((force.real, force.imag, -skin * rubs))
            # As the object turns under a tube, the point that touches moves back on its surface.
            swung = 1j * (arm - radius * axis * own)
            swing += (swung.conjugate() * 1j * axis * force).real / unit
            inclined = -1j * (radius + skin) * own
            moved = (-back, -1j * back, -back * swung, 1.0 + 0j, inclined, soft * own)
            touch.append((*(z.real for z in moved), *(z.imag for z in moved), -1.0 - slope**2))
            # By inclination, normal force and friction force.
            for change, moment, less in (
                (1j * force, 0.0, radius * presses / unit),
                (own, soft * rubs, 0.0),
                (1j * own, -skin, 0.0),
            ):
                pushed = axis * change
                pushes.append((change.real, change.imag, moment))
                balance.append((-pushed.real, -pushed.imag, less - (lever * pushed).imag))

        residual, jacobian = np.empty(places.size), np.zeros((places.size, places.size))
        contact, acting = self.compliance.at(feet), np.array(loads)
        touching = (contact.matrix.reshape(3 * count, -1) @ acting.ravel()).reshape(count, 3)
        residual[: 3 * count] = (touching + gaps + self.given).T.ravel()
        residual[places.balance] = wrench - (total.real, total.imag, turning)
        bending = slice(places.inclinations.start, None)  # inclinations and forces
        rows = jacobian[: 3 * count].reshape(3, count, -1)  # response, contact
        rows[:, :, places.feet] = contact.rates(acting).transpose(1, 0, 2)
        changes = np.reshape(pushes, (count, 3, 3))
        bends = np.einsum('raic,inc->arni', contact.matrix, changes)
        rows[:, :, bending] = bends.reshape(3, count, -1)
        jacobian.ravel()[_touch_places(count)] += touch
        of_balance = np.reshape(balance, (count, 3, 3)).transpose(2, 1, 0)
        jacobian[places.balance, bending] = of_balance.reshape(3, -1)
        jacobian[places.balance.start + 2, ANGLE] = swing
        residual[places.closure], jacobian[places.closure] = closure(unknowns, normals)
        return residual, jacobian, normals

    def rolling_rows(self, unknowns: Array, normals: Points) -> Array:
        """
        Return the derivative (k, 3 + 4k) of what stays as contacts roll, see `anchors`.

        :param unknowns: see `ContactForces`.
        :param normals: (k,) from the object toward the tubes.
        """
        places, count = self.places, len(normals)
        derivative, own = np.zeros((count, places.size)), np.arange(count)
        facing = normals * np.exp(-1j * unknowns[ANGLE])
        radii = self.body.shape.surface_at(self.contacts.corners, facing)[1]
        derivative[:, ANGLE] = radii
        derivative[own, places.feet.start + own] = -self.sides
        derivative[own, places.inclinations.start + own] = -radii
        return derivative

    def anchors(self, unknowns: Array, normals: Points, travel: Array, angles: Array) -> Array:
        """
        Return what stays as it is while the contacts roll, (k,) [m].

            A_i = kappa_i (s_i - phi_i) - arc(arg nu_i - theta)

        :param unknowns: see `ContactForces`.
        :param normals: (k,) from the object toward the tubes.
        :param travel: (k,) phi_i of the modules at the members' starts [m].
        :param angles: (k,) of the normals in the object's frame before, not wrapped [rad].
        """
        found = unwrapped(unknowns, normals, angles)
        arcs = self.body.shape.unroll(found, self.contacts.corners)
        return -self.sides * (unknowns[self.places.feet] - travel) - arcs

    def solve(
        self, start: Array, wrench: Array, closure: Closure, steps: int = MAX_STEPS
    ) -> ContactForces | None:
        """
        Return the equilibrium near a start (Newton's method), or None if it is not found.

        :param start: (3 + 4k,) unknowns to begin with.
        :param wrench: (fx, fy, m / arm) on the object [N].
        :param closure: what settles the equations that statics leaves open.
        :param steps: most states that are looked at.
        """
        places, unknowns = self.places, start.copy()
        longest = _longest_step(len(self.sides), self.body.arm)
        for _ in range(steps):
            residual, jacobian, normals = self.equations(unknowns, wrench, closure)
            least = np.full(places.size, LENGTH_TOLERANCE)
            least[places.balance] = FORCE_TOLERANCE * np.abs(unknowns[places.normal]).sum()
            # What is no number is no solution either.
            if (np.abs(residual) <= least).all():
                folded = np.abs(unknowns[places.inclinations]).max() > MAX_INCLINATION
                return None if folded else ContactForces(unknowns, normals, jacobian)
            _, _, step, singular = lapack.dgesv(jacobian, -residual)
            size = np.abs(step)
            if singular or not size.max() < np.inf:
                return None
            unknowns = unknowns + step / max(1.0, float((size / longest).max()))
        return None


def unwrapped(unknowns: Array, normals: Points, angles: Array) -> Array:
    """
    Return the angles of normals in the object's frame, within half a turn of others, (k,) [rad].

    :param unknowns: see `ContactForces`.
    :param normals: (k,) from the object toward the tubes.
    :param angles: (k,) others, not wrapped [rad].
    """
    own = normals * np.exp(-1j * unknowns[ANGLE])
    return angles + np.angle(own * np.exp(-1j * angles))


@functools.lru_cache(maxsize=16)
def _longest_step(count: int, arm: float) -> Array:
    """Return by how much the unknowns (3 + 4k,) of k contacts change in one step at most."""
    places = Places.of(count)
    longest = np.full(places.size, MAX_MOVE * arm)
    longest[ANGLE], longest[places.inclinations] = MAX_TURN, MAX_TURN
    longest[places.normal] = longest[places.friction] = np.inf
    longest.flags.writeable = False
    return longest


@functools.lru_cache(maxsize=16)
def _touch_places(count: int) -> Indices:
    """Return where in the flat Jacobian derivatives of touch and inclination are, (k, 13)."""
    # Rows: along and across the members; columns: x, y, the angle, and foot, inclination and
    # normal force of the contact itself. The last is that of the inclination by itself.
    places, own = Places.of(count), np.arange(count)
    pose = np.broadcast_to(np.arange(POSE)[:, None], (POSE, count))
    each = [place.start + own for place in (places.feet, places.inclinations, places.normal)]
    columns = np.concatenate([pose, each])
    along = own * places.size + columns
    inclined = (own + 2 * count) * places.size + places.inclinations.start + own
    return np.concatenate([along, along + count * places.size, inclined[None]]).T
