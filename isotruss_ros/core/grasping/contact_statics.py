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

The equations are those of `equilibrium`, for any shape and for k contacts on two members or three:

    X_i = P_i + s_i e_i + u_i,  u = C f,  f_i = (N_i + i T_i) nu_i      deformed point of contact
    X_i = c + R(theta) p(nu_i) + rho_i nu_i                             touch
    w = sum f_i,  m = sum of arms x f_i                                 balance

with p(nu) the point of the surface whose normal is nu, and rho_i from there to the centre line.
A beam bends away from what presses on it: of a polygon it touches corners, and a face that lies on
it with both of its ends. `closures` has the k rows that statics leaves open.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from isotruss_ros.core.grasping.balance import (
    ANGLE,
    Closure,
    ContactForces,
    MAX_TURN,
    Places,
    solve_balance,
)
from isotruss_ros.core.grasping.member_compliance import MemberCompliance
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.ellipse import Ellipse
from isotruss_ros.core.model.polygon import Polygon
from isotruss_ros.core.model.shapes import Disc, Shape
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
import numpy as np


@dataclass(frozen=True, eq=False)
class ContactStatics:
    """
    The equations of a convex object at k contacts.

    :ivar compliance: of the structure on the members of the contacts.
    :ivar body: the object, near where it is.
    :ivar owners: (k,) to which member of the grip each contact belongs: 0, 0, 1, ...
    :ivar corners: (k,) which corner of a polygon touches; else not used.
    :ivar tube_radius: [m].
    :ivar sides: (k,) +1 where the object is on the right of the member (seen along its axis from
        its start), -1 on the left.
    :ivar indentation: depths (k,) of the dents in the skin [m] for normal forces (k,) [N], and
        their derivatives [m/N].
    """

    compliance: MemberCompliance
    body: ConvexObject
    owners: Indices
    corners: Indices
    tube_radius: float
    sides: Array
    indentation: Callable[[Array], tuple[Array, Array]]

    @property
    def places(self) -> Places:
        """Return where what is among the unknowns."""
        return Places.of(len(self.owners))

    @property
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
        places, count = self.places, len(self.owners)
        center, turn = complex(unknowns[0], unknowns[1]), np.exp(1j * unknowns[ANGLE])
        feet, turned = unknowns[places.feet], unknowns[places.inclinations]
        normal, friction = unknowns[places.normal], unknowns[places.friction]
        axis = self.compliance.axis
        local = 1j * self.sides * np.exp(1j * turned)  # normals along and across the members
        normals = axis * local
        points, radii = surface_points(self.body.shape, normals * turn.conjugate(), self.corners)
        arms = turn * points
        depth, soft = self.indentation(normal)
        skin = self.tube_radius - depth
        force = (normal + 1j * friction) * local
        loads = np.column_stack([force.real, force.imag, -skin * friction])
        contact = self.compliance.at(feet)
        give = contact.respond(loads)

        residual, jacobian = np.zeros(places.size), np.zeros((places.size, places.size))
        gap = axis.conj() * (self.compliance.start - center - arms) + feet - skin * local
        gap += give[:, 0] + 1j * give[:, 1]
        residual[: 3 * count] = np.concatenate([gap.real, gap.imag, give[:, 2] - np.tan(turned)])
        pushed = (normal + 1j * friction) * normals
        lever = arms.conj() / self.arm
        total = pushed.sum()
        residual[places.balance] = wrench - (total.real, total.imag, (lever * pushed).imag.sum())

        # Loads by inclinations, normal forces and friction forces, which follow each other.
        forces = np.concatenate([1j * force, local, 1j * local])
        moments = np.concatenate([np.zeros(count), soft * friction, -skin])
        rows = jacobian[: 3 * count].reshape(3, count, -1).transpose(1, 0, 2)  # contact, response
        rows[:, :, places.feet] = contact.rates(loads)
        rows[:, :, slice(places.inclinations.start, None)] = contact.respond_each(forces, moments)
        own = np.arange(count)
        # As the object turns under a tube, the point that touches moves back on its surface.
        swung = 1j * (arms - radii * normals)
        for place, change in ((0, axis.conj()), (1, 1j * axis.conj()), (2, axis.conj() * swung)):
            jacobian[own, place], jacobian[own + count, place] = -change.real, -change.imag
        jacobian[own, places.feet.start + own] += 1.0
        for place, change in (
            (places.inclinations, -(radii + skin) * 1j * local),
            (places.normal, soft * local),
        ):
            jacobian[own, place.start + own] += change.real
            jacobian[own + count, place.start + own] += change.imag
        tilted = places.inclinations.start + own
        jacobian[own + 2 * count, tilted] -= 1.0 + np.tan(turned) ** 2
        first, second, last = range(places.balance.start, places.balance.stop)
        jacobian[last, ANGLE] = -(swung.conj() / self.arm * pushed).imag.sum()
        rolled = (1j * radii * normals).conj() / self.arm
        for place, change, moment in (
            (places.inclinations, 1j * pushed, rolled * pushed + lever * 1j * pushed),
            (places.normal, normals, lever * normals),
            (places.friction, 1j * normals, lever * 1j * normals),
        ):
            jacobian[first, place], jacobian[second, place] = -change.real, -change.imag
            jacobian[last, place] = -moment.imag
        residual[places.closure], jacobian[places.closure] = closure(unknowns, normals)
        return residual, jacobian, normals

    def solve(self, start: Array, wrench: Array, closure: Closure) -> ContactForces | None:
        """
        Return the equilibrium near a start (Newton's method), or None if it is not found.

        :param start: (3 + 4k,) unknowns to begin with.
        :param wrench: (fx, fy, m / arm) on the object [N].
        :param closure: what settles the equations that statics leaves open.
        """
        return solve_balance(
            lambda unknowns: self.equations(unknowns, wrench, closure), start, self.arm, MAX_TURN
        )


def surface_points(shape: Shape, normals: Points, corners: Indices) -> tuple[Points, Array]:
    """
    Return points of a shape with given normals, and the radii of curvature there, (k,) each [m].

    :param shape: a `Disc`, `Ellipse` or `Polygon`.
    :param normals: (k,) outward unit normals in the shape's frame.
    :param corners: (k,) corners of a polygon, whose arcs go on beyond their ends.
    """
    if isinstance(shape, Polygon):
        radii = shape.radii[corners]
        return shape.arc_centers[corners] + radii * normals, radii
    points = shape.support_points(normals)
    if isinstance(shape, Ellipse):
        a, b = shape.semi_axes
        return points, (a * b) ** 2 / shape.support(normals) ** 3
    assert isinstance(shape, Disc)
    return points, np.full(len(normals), 0.5 * shape.diameter)
