# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The equilibrium of an object between two members, friction loading the tubes as well.

Unknowns are the object's pose, where along the members it touches them, how their bent centre
lines are inclined there, and the contact forces:

    X_i = P_i + s_i e_i + u_i,  u = C f,  f_i = (N_i + i T_i) nu_i      deformed point of contact
    X_i = c + rho_i nu_i,       nu_i normal to the bent tube            touch
    w = sum f_i,  m = r sum T_i                                         balance

What is left is settled by what is known of the past: `Closure` has the rows for it. Friction acts
at the tube's skin, so that it turns the tube as well, by T_i (rho_i - r).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, sin, tan

from isotruss_ros.core.grasping.balance import (
    ANGLE,
    Closure,
    ContactForces,
    MAX_STEPS,
    Places,
    solve_balance,
)
from isotruss_ros.core.grasping.member_compliance import MemberCompliance
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
import numpy as np

#: Places of the unknowns and rows of two contacts.
FEET, INCLINATIONS, NORMAL, FRICTION, BALANCE, CLOSURE, SIZE = Places.of(2)
#: Where what each contact adds to the Jacobian goes: touch along and across the member by pose and
#: foot, these and the inclination by the inclination, touch by the normal force, then the balance
#: by inclination, normal force and friction.
ENTRIES = np.array(
    [
        SIZE * row + column
        for i in range(2)
        for row, column in (
            *((i, 0), (i, 1), (2 + i, 0), (2 + i, 1), (i, 3 + i)),
            *((i, 5 + i), (2 + i, 5 + i), (4 + i, 5 + i)),
            *((i, 7 + i), (2 + i, 7 + i)),
            *((6, 5 + i), (7, 5 + i), (6, 7 + i), (7, 7 + i), (6, 9 + i), (7, 9 + i), (8, 9 + i)),
        )
    ]
)
#: Where what changes the loads of each contact goes: along, across and moment, by inclinations,
#: normal and friction forces of both.
CHANGES = np.array(
    [6 * (3 * i + row) + 2 * kind + i for i in range(2) for row in range(3) for kind in range(3)]
)
#: One contact for each of the two members.
OWNERS = np.arange(2)
OWNERS.flags.writeable = False


def no_indentation(forces: Array) -> tuple[Array, Array]:
    """
    Return depths and derivatives of tubes that stay round: zero.

    :param forces: (k,) normal forces [N].
    """
    return np.zeros(len(forces)), np.zeros(len(forces))


@dataclass(frozen=True, eq=False)
class HeldObjectStatics:
    """
    The equations of an object between two members.

    :ivar compliance: of the structure on the two members.
    :ivar radius: of the object [m].
    :ivar tube_radius: [m].
    :ivar sides: (2,) +1 where the object is on the right of the member (seen along its axis from
        its start), -1 on the left.
    :ivar indentation: depths (2,) of the dents in the skin [m] for normal forces (2,) [N], and
        their derivatives [m/N].
    """

    compliance: MemberCompliance
    radius: float
    tube_radius: float
    sides: Array
    indentation: Callable[[Array], tuple[Array, Array]] = no_indentation

    @property
    def arm(self) -> float:
        """Return the arm by which moments compare with forces: the radius [m]."""
        return self.radius

    @property
    def owners(self) -> Indices:
        """Return to which member of the grip each contact belongs, (2,)."""
        return OWNERS

    def equations(
        self, unknowns: Array, wrench: Array, closure: Closure
    ) -> tuple[Array, Array, Points]:
        """
        Return residual (11,), Jacobian (11, 11) and normals (2,).

        :param unknowns: (11,), see `ContactForces`.
        :param wrench: (fx, fy, m / radius) on the object [N].
        :param closure: the remaining two equations, of friction or of rolling.
        """
        x, y, _, *each = unknowns.tolist()
        depth, soft = self.indentation(unknowns[NORMAL])
        depths, softness = depth.tolist(), soft.tolist()
        contact = self.compliance.at(unknowns[FEET])
        axes, starts = self.compliance.axis.tolist(), self.compliance.start.tolist()
        center, pushed = complex(x, y), 0j
        loads, changes, entries, normals, along, across, slopes = [], [], [], [], [], [], []
        # One by one: two numbers of Python are quicker than an array of them.
        for i, side in enumerate(self.sides.tolist()):
            foot, turned, pressed, rubbed = each[i::2]
            axis, skin, dent = axes[i], self.tube_radius - depths[i], softness[i]
            # The normal along and across the member.
            own, tangent = complex(-side * sin(turned), side * cos(turned)), tan(turned)
            force, reach = complex(pressed, rubbed) * own, self.radius + skin
            loads += [force.real, force.imag, -skin * rubbed]
            # Loads by inclination, normal force and friction force.
            changes += [
                *(-force.imag, own.real, -own.imag),
                *(force.real, own.imag, own.real),
                *(0.0, dent * rubbed, -skin),
            ]
            gap = axis.conjugate() * (starts[i] - center) + foot - reach * own
            along.append(gap.real)
            across.append(gap.imag)
            slopes.append(-tangent)
            normal = axis * own
            push = complex(pressed, rubbed) * normal
            normals.append(normal)
            pushed += push
            entries += [
                *(-axis.real, -axis.imag, axis.imag, -axis.real, 1.0),
                *(reach * own.imag, -reach * own.real, -1.0 - tangent * tangent),
                *(dent * own.real, dent * own.imag),
                *(push.imag, -push.real, -normal.real, -normal.imag, normal.imag, -normal.real),
                -1.0,
            ]
        values = np.array([*entries, *changes, *loads, *along, *across, *slopes])
        residual, jacobian = np.empty(SIZE), np.zeros((SIZE, SIZE))
        first, second, third = len(ENTRIES), len(ENTRIES) + len(CHANGES), len(values) - 6
        jacobian.ravel()[ENTRIES] = values[:first]
        changing = np.zeros((6, 6))
        changing.ravel()[CHANGES] = values[first:second]
        flat, given = contact.matrix.reshape(6, 6), values[second:third]
        rows = jacobian[:6].reshape(3, 2, SIZE).transpose(1, 0, 2)  # contact, response
        rows[:, :, FEET] += contact.rates(given.reshape(2, 3))
        rows[:, :, slice(INCLINATIONS.start, None)] += (flat @ changing).reshape(2, 3, 6)
        residual[:6] = values[third:] + (flat @ given).reshape(2, 3).T.ravel()
        residual[6], residual[7] = wrench[0] - pushed.real, wrench[1] - pushed.imag
        residual[8] = wrench[2] - each[6] - each[7]
        found = np.array(normals)
        residual[CLOSURE], jacobian[CLOSURE] = closure(unknowns, found)
        return residual, jacobian, found

    def solve(
        self, start: Array, wrench: Array, closure: Closure, steps: int = MAX_STEPS
    ) -> ContactForces | None:
        """
        Return the equilibrium near a start (Newton's method), or None if it is not found.

        :param start: (11,) unknowns to begin with.
        :param wrench: (fx, fy, m / radius) on the object [N].
        :param closure: what settles the two equations that statics leaves open.
        :param steps: most states that are looked at.
        """

        def equations(unknowns: Array) -> tuple[Array, Array, Points]:
            return self.equations(unknowns, wrench, closure)

        return solve_balance(equations, start, self.arm, np.inf, steps)


def keep_place(center: complex, angle: float) -> Closure:
    """
    Return the closure for an unknown past: the pose is near to a measured one.

    Statics leaves the place along the bisector of the members open, which settles how hard they
    press, and the angle: both are those of the measured pose.

    :param center: measured, x + iy [m].
    :param angle: measured [rad].
    """

    def rows(unknowns: Array, normals: Points) -> tuple[Array, Array]:
        # Across the chord between the contacts.
        chord = complex(normals[0] - normals[1])
        size = max(abs(chord), 1e-9)
        along = 1j * chord / size
        away = complex(unknowns[0], unknowns[1]) - center
        derivative = np.zeros((2, SIZE))
        derivative[0, 0], derivative[0, 1] = along.real, along.imag
        for i, sign in ((0, 1.0), (1, -1.0)):
            moved = sign * 1j * complex(normals[i])  # of the chord, as the tube inclines
            turned = (chord.conjugate() * moved).imag / size**2
            derivative[0, 5 + i] = turned * ((1j * along).conjugate() * away).real
        derivative[1, ANGLE] = 1.0
        return np.array([(along.conjugate() * away).real, unknowns[ANGLE] - angle]), derivative

    return rows


def roll(anchors: Array, travel: Array, statics: HeldObjectStatics) -> Closure:
    """
    Return the closure for contacts that roll without slip, (17) integrated.

        kappa_i (s_i - phi_i) + r (theta - arg nu_i) = A_i

    The pose is a function of the configuration: nothing is integrated, so nothing drifts.

    :param anchors: (2,) A_i, see `find_anchors` [m].
    :param travel: (2,) phi_i of the modules at the members' starts [m].
    :param statics: the equations of the held object.
    """
    derivative = rolling_rows(statics)
    fixed = find_anchors(np.zeros(SIZE), travel, statics) - anchors
    # The direction of a member, and with it all of this, is known up to whole turns.
    around = 2.0 * np.pi * statics.radius

    def rows(unknowns: Array, normals: Points) -> tuple[Array, Array]:
        left = derivative @ unknowns + fixed
        return left - around * np.round(left / around), derivative

    return rows


def rolling_rows(statics: HeldObjectStatics) -> Array:
    """
    Return the derivative (2, 11) of what `find_anchors` returns.

    :param statics: the equations of the held object.
    """
    derivative = np.zeros((2, SIZE))
    for i, side in enumerate(statics.sides.tolist()):
        row = derivative[i]
        row[ANGLE], row[3 + i], row[5 + i] = statics.radius, -side, -statics.radius
    return derivative


def find_anchors(unknowns: Array, travel: Array, statics: HeldObjectStatics) -> Array:
    """
    Return what stays as it is while the contacts roll, (2,) [m].

    :param unknowns: (11,), see `ContactForces`.
    :param travel: (2,) phi_i of the modules at the members' starts [m].
    :param statics: the equations of the held object.
    """
    # A member seen counter-clockwise around the object runs along its axis or against it.
    turned = np.angle(statics.compliance.axis) + unknowns[INCLINATIONS]
    return -statics.sides * (unknowns[FEET] - travel) + statics.radius * (unknowns[ANGLE] - turned)
