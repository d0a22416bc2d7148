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
it with both of its ends. `contact_closures` has the k rows that statics leaves open.
"""

from __future__ import annotations

import cmath
from dataclasses import dataclass
import functools
from typing import NamedTuple

from isotruss_ros.core.holding.balance import (
    ANGLE,
    Closure,
    ContactForces,
    MAX_STEPS,
    MAX_TURN,
    Places,
    POSE,
    solve_balance,
)
from isotruss_ros.core.holding.indentation import Dents
from isotruss_ros.core.holding.pressed_contacts import PressedContacts
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.statics.member_compliance import MemberCompliance
from isotruss_ros.core.statics.section import Pressure
import numpy as np


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
    """

    compliance: MemberCompliance
    body: ConvexObject
    contacts: PressedContacts
    tube_radius: float
    sides: Array
    indentation: Dents

    @functools.cached_property
    def places(self) -> Places:
        """Return where what is among the unknowns."""
        return Places.of(len(self.contacts.owners))

    @functools.cached_property
    def arm(self) -> float:
        """Return the arm by which moments compare with forces, see `ConvexObject.arm` [m]."""
        return self.body.arm

    @property
    def straight_normals(self) -> Points:
        """Return the normals of the tubes as long as they are straight, from the object (k,)."""
        return 1j * self.sides * self.compliance.axis

    def loads(self, unknowns: Array) -> Array:
        """
        Return forces along and across the members [N] and moments [N m] of the contacts, (k, 3).

        :param unknowns: see `ContactForces`.
        """
        places = self.places
        normal, friction = unknowns[places.normal], unknowns[places.friction]
        local = 1j * self.sides * np.exp(1j * unknowns[places.inclinations])
        force = (normal + 1j * friction) * local
        skin = self.tube_radius - self.indentation(normal)[0]
        return np.column_stack([force.real, force.imag, -skin * friction])

    def equations(
        self, unknowns: Array, wrench: Array, closure: Closure
    ) -> tuple[Array, Array, Points]:
        """
        Return residual (3 + 4k,), its Jacobian and normals (k,).

        :param unknowns: see `ContactForces`.
        :param wrench: (fx, fy, m / arm) on the object [N].
        :param closure: the remaining equations, of friction or of rolling.
        """
        places, count, axis = self.places, len(self.sides), self.compliance.axis
        center, turn = complex(unknowns[0], unknowns[1]), cmath.rect(1.0, unknowns[ANGLE])
        feet, turned, normal, friction = unknowns[POSE:].reshape(4, count)
        local = 1j * self.sides * np.exp(1j * turned)  # normals along and across the members
        normals, slopes = axis * local, np.tan(turned)
        points, radii = self.body.shape.surface_at(
            self.contacts.corners, normals * turn.conjugate()
        )
        arms = turn * points
        depth, soft = self.indentation(normal)
        skin = self.tube_radius - depth
        force = (normal + 1j * friction) * local
        loads = np.array([force.real, force.imag, -skin * friction]).T
        contact = self.compliance.at(feet)
        give = contact.respond(loads)

        residual, jacobian = np.empty(places.size), np.zeros((places.size, places.size))
        back = axis.conj()
        gap = back * (self.compliance.start - center - arms) + feet - skin * local
        touching = np.array([gap.real, gap.imag, -slopes]) + give.T
        residual[: places.balance.start] = touching.ravel()
        bending = slice(places.inclinations.start, None)  # inclinations and forces
        # Forces by inclinations, normal forces and friction forces, which follow each other.
        changes = np.array([1j * force, local, 1j * local])
        moments = np.array([np.zeros(count), soft * friction, -skin])
        pushed, lever = axis * changes, arms.conj() / self.arm
        torques, total = (lever * pushed).imag, -1j * pushed[0].sum()
        turning = -float((lever * pushed[0]).real.sum())
        residual[places.balance] = wrench - (total.real, total.imag, turning)

        rows = jacobian[: 3 * count].reshape(3, count, -1).transpose(1, 0, 2)  # contact, response
        rows[:, :, places.feet] = contact.rates(loads)
        rows[:, :, bending] = contact.respond_each(changes.ravel(), moments.ravel())
        # As the object turns under a tube, the point that touches moves back on its surface.
        swung = 1j * (arms - radii * normals)
        touch = np.array(
            [
                -back,
                -1j * back,
                -back * swung,
                np.ones(count),
                -1j * (radii + skin) * local,
                soft * local,
            ]
        )
        jacobian.ravel()[_touch_places(count)] += np.array([touch.real, touch.imag], order='C')
        torques[0] -= radii * normal / self.arm
        own = np.arange(count)
        jacobian[own + 2 * count, own + places.inclinations.start] -= 1.0 + slopes**2
        balance = jacobian[places.balance]
        balance[2, ANGLE] = (swung.conj() * 1j * pushed[0]).imag.sum() / self.arm
        balance[:, bending] = -np.array([pushed.real, pushed.imag, torques]).reshape(3, -1)
        residual[places.closure], jacobian[places.closure] = closure(unknowns, normals)
        return residual, jacobian, normals

    def rolling_rows(self, unknowns: Array, normals: Points) -> Array:
        """
        Return the derivative (k, 3 + 4k) of what stays as contacts roll, see `find_anchors`.

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

        def equations(unknowns: Array) -> tuple[Array, Array, Points]:
            return self.equations(unknowns, wrench, closure)

        return solve_balance(equations, start, self.arm, MAX_TURN, steps)


@functools.lru_cache(maxsize=16)
def _touch_places(count: int) -> Indices:
    """
    Return where in the Jacobian, flat, the derivatives of touch are, (2, 6, k).

    Rows are along and across the members; columns are x, y, the angle, and foot, inclination and
    normal force of the contact itself.

    :param count: k.
    """
    places, own = Places.of(count), np.arange(count)
    pose = np.broadcast_to(np.arange(POSE)[:, None], (POSE, count))
    each = [place.start + own for place in (places.feet, places.inclinations, places.normal)]
    rows = np.stack([own, own + count])[:, None]
    return rows * places.size + np.concatenate([pose, each])
