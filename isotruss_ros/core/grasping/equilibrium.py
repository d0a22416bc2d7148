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
from math import tan

from isotruss_ros.core.grasping.balance import (
    ANGLE,
    Closure,
    ContactForces,
    Places,
    solve_balance,
)
from isotruss_ros.core.grasping.member_compliance import MemberCompliance
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
import numpy as np

#: Places of the unknowns and rows of two contacts.
FEET, INCLINATIONS, NORMAL, FRICTION, BALANCE, CLOSURE, SIZE = Places.of(2)
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
        normal, friction = unknowns[NORMAL], unknowns[FRICTION]
        # Normals along and across the members.
        local = 1j * self.sides * np.exp(1j * unknowns[INCLINATIONS])
        depth, soft = self.indentation(normal)
        skin = self.tube_radius - depth
        force = (normal + 1j * friction) * local
        loads = np.empty((2, 3))
        loads[:, 0], loads[:, 1], loads[:, 2] = force.real, force.imag, -skin * friction
        contact = self.compliance.at(unknowns[FEET])

        residual, jacobian = np.zeros(SIZE), np.zeros((SIZE, SIZE))
        # Loads by inclinations, normal forces and friction forces, which follow each other.
        forces = np.concatenate([1j * force, local, 1j * local])
        moments = np.concatenate([np.zeros(2), soft * friction, -skin])
        rows = jacobian[:6].reshape(3, 2, SIZE).transpose(1, 0, 2)  # contact, response
        rows[:, :, FEET] = contact.rates(loads)
        rows[:, :, slice(INCLINATIONS.start, None)] = contact.respond_each(forces, moments)
        x, y, _, *each = unknowns.tolist()
        center, pushed = complex(x, y), 0j
        given = (self.compliance.axis, self.compliance.start, local, skin, soft)
        axes, starts, normals_within, skins, softness = [values.tolist() for values in given]
        # One by one: two numbers of Python are quicker than an array of them.
        for i, (along, across, slope) in enumerate(contact.respond(loads).tolist()):
            foot, turned, pressed, rubbed = each[i::2]
            axis, own = axes[i], normals_within[i]
            reach, tangent = self.radius + skins[i], tan(turned)
            gap = axis.conjugate() * (starts[i] - center) + foot - reach * own
            residual[i], residual[2 + i] = gap.real + along, gap.imag + across
            residual[4 + i] = slope - tangent
            jacobian[i, 0], jacobian[i, 1] = -axis.real, -axis.imag
            jacobian[2 + i, 0], jacobian[2 + i, 1] = axis.imag, -axis.real
            jacobian[i, 3 + i] += 1.0
            turn, dent = -reach * 1j * own, softness[i] * own
            jacobian[i, 5 + i] += turn.real
            jacobian[2 + i, 5 + i] += turn.imag
            jacobian[4 + i, 5 + i] -= 1.0 + tangent**2
            jacobian[i, 7 + i] += dent.real
            jacobian[2 + i, 7 + i] += dent.imag
            push = complex(pressed, rubbed) * axis * own
            pushed += push
            for place, change in ((5, 1j * push), (7, axis * own), (9, 1j * axis * own)):
                jacobian[6, place + i], jacobian[7, place + i] = -change.real, -change.imag
            jacobian[8, 9 + i] = -1.0
        residual[6], residual[7] = wrench[0] - pushed.real, wrench[1] - pushed.imag
        residual[8] = wrench[2] - each[6] - each[7]
        normals = self.compliance.axis * local
        residual[CLOSURE], jacobian[CLOSURE] = closure(unknowns, normals)
        return residual, jacobian, normals

    def solve(self, start: Array, wrench: Array, closure: Closure) -> ContactForces | None:
        """
        Return the equilibrium near a start (Newton's method), or None if it is not found.

        :param start: (11,) unknowns to begin with.
        :param wrench: (fx, fy, m / radius) on the object [N].
        :param closure: what settles the two equations that statics leaves open.
        """
        return solve_balance(
            lambda unknowns: self.equations(unknowns, wrench, closure), start, self.arm, np.inf
        )


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
    derivative = np.zeros((2, SIZE))
    derivative[:, ANGLE] = statics.radius
    derivative[:, FEET] = np.diag(-statics.sides)
    derivative[:, INCLINATIONS] = -statics.radius * np.eye(2)
    # The direction of a member, and with it all of this, is known up to whole turns.
    around = 2.0 * np.pi * statics.radius

    def rows(unknowns: Array, normals: Points) -> tuple[Array, Array]:
        left = find_anchors(unknowns, travel, statics) - anchors
        return left - around * np.round(left / around), derivative

    return rows


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
