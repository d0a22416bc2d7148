"""How far a held object is from slipping: contacts stick, forces redistribute with the tubes."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.grasping.equilibrium import (
    BALANCE,
    FRICTION,
    HeldObjectStatics,
    HeldState,
    NORMAL,
    roll,
    SIZE,
)
from isotruss_ros.core.numerics.arrays import Array
import numpy as np


@dataclass(frozen=True, eq=False)
class WrenchResponse:
    """
    What a small external wrench (fx, fy, m / radius) [N] does to a held object.

    :ivar pose: (3, 3) displacement of (x, y, angle) [m/N, rad/N].
    :ivar normal: (2, 3) change of the normal forces [-].
    :ivar friction: (2, 3) change of the friction forces [-].
    :ivar radius: of the object [m].
    """

    pose: Array
    normal: Array
    friction: Array
    radius: float

    @property
    def stiffness(self) -> Array:
        """Return the wrench (fx, fy, m) that a displacement takes, (3, 3) [N/m, N, N m]."""
        stiffness = np.linalg.inv(self.pose)
        stiffness[2] *= self.radius
        return stiffness

    @property
    def stable(self) -> bool:
        """Return whether every displacement takes work."""
        even = self.pose * np.array([[1.0], [1.0], [self.radius]])
        return bool(np.linalg.eigvalsh(0.5 * (even + even.T)).min() > 0.0)


def wrench_response(
    statics: HeldObjectStatics, state: HeldState, wrench: Array
) -> WrenchResponse | None:
    """
    Return how pose and forces of a held object answer to a wrench while the contacts stick.

    :param statics: the equations.
    :param state: the equilibrium.
    :param wrench: (fx, fy, m / radius) in it [N].
    :return: None where the equilibrium is indifferent: its Jacobian is singular.
    """
    closure = roll(np.zeros(2), np.zeros(2), statics)
    _, jacobian, _ = statics.equations(state.unknowns, wrench, closure)
    right = np.zeros((SIZE, 3))
    right[BALANCE] = -np.eye(3)
    try:
        change = np.linalg.solve(jacobian, right)
        np.linalg.inv(change[:3])
    except np.linalg.LinAlgError:
        return None
    return WrenchResponse(change[:3], change[NORMAL], change[FRICTION], statics.radius)


def slip_margin(state: HeldState, response: WrenchResponse, friction: float) -> float:
    """
    Return the smallest wrench at which a contact slips, |T| = mu N, or lets go, N = 0 [N].

    Moments count over the object's radius. Forces change linearly with the wrench, so that each
    condition is a plane in the space of wrenches, and the margin the distance of the nearest one.

    :param state: the equilibrium.
    :param response: how its forces change with the wrench.
    :param friction: coefficient mu.
    :return: negative where a contact slips or pulls already.
    """
    reserve, slope = _conditions(state, response, friction)
    return float((reserve / np.linalg.norm(slope, axis=1)).min())


def weakest_direction(state: HeldState, response: WrenchResponse, friction: float) -> Array:
    """
    Return the unit wrench (fx, fy, m / radius) along which the slip margin is the least, (3,).

    :param state: the equilibrium.
    :param response: how its forces change with the wrench.
    :param friction: coefficient mu.
    """
    reserve, slope = _conditions(state, response, friction)
    size = np.linalg.norm(slope, axis=1)
    nearest = int((reserve / size).argmin())
    return -slope[nearest] / size[nearest]


def _conditions(
    state: HeldState, response: WrenchResponse, friction: float
) -> tuple[Array, Array]:
    """Return what is left until each contact slips or lets go (6,), and its slopes (6, 3)."""
    normal, tangential = state.normal_forces, state.friction_forces
    reserve = np.concatenate(
        [friction * normal - tangential, friction * normal + tangential, normal]
    )
    slope = np.concatenate(
        [
            friction * response.normal - response.friction,
            friction * response.normal + response.friction,
            response.normal,
        ]
    )
    return reserve, slope
