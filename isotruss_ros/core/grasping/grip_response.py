"""How a held object answers to small wrenches and to members that move: contacts stick."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.grasping.contact_statics import (
    ContactClosure,
    ContactForces,
    ContactStatics,
)
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
import numpy as np


@dataclass(frozen=True, eq=False)
class GripResponse:
    """
    What a small external wrench (fx, fy, m / arm) [N] does to an object at k contacts.

    :ivar pose: (3, 3) displacement of (x, y, angle) [m/N, rad/N].
    :ivar normal: (k, 3) change of the normal forces [-].
    :ivar friction: (k, 3) change of the friction forces [-].
    :ivar opening: (k,) change of the normal forces as the members move apart [N/m].
    :ivar openings: (m, m) change of the members' normal forces as each of them moves away from the
        object [N/m].
    :ivar forces: the equilibrium.
    :ivar owners: (k,) to which member of the grip each contact belongs.
    :ivar arm: by which moments compare with forces [m].
    """

    pose: Array
    normal: Array
    friction: Array
    opening: Array
    openings: Array
    forces: ContactForces
    owners: Indices
    arm: float

    @property
    def stiffness(self) -> Array:
        """Return the wrench (fx, fy, m) that a displacement takes, (3, 3) [N/m, N, N m]."""
        stiffness = np.linalg.inv(self.pose)
        stiffness[2] *= self.arm
        return stiffness

    @property
    def stable(self) -> bool:
        """Return whether every displacement takes work."""
        even = self.pose * np.array([[1.0], [1.0], [self.arm]])
        return bool(np.linalg.eigvalsh(0.5 * (even + even.T)).min() > 0.0)

    @property
    def squeeze_by_opening(self) -> float:
        """Return the change of the mean normal force of the members as they move apart [N/m]."""
        return float(self.opening.sum()) / (int(self.owners[-1]) + 1)

    def slip_margin(self, friction: float) -> float:
        """
        Return the smallest wrench at which a member slips or a contact lets go [N].

        Moments count over the arm. A member slips where the friction of all its contacts,
        |T| = mu N of their sums, is used; each end of a face lets go at N = 0. Forces change
        linearly with the wrench: the margin is the distance of the nearest of these planes.

        :param friction: coefficient mu.
        :return: negative where a member slips or a contact pulls already.
        """
        members = np.eye(int(self.owners[-1]) + 1)[self.owners].T
        normal, rubs = members @ self.forces.normal_forces, members @ self.forces.friction_forces
        by_normal, by_friction = members @ self.normal, members @ self.friction
        reserve = np.concatenate(
            [friction * normal - rubs, friction * normal + rubs, self.forces.normal_forces]
        )
        slope = np.concatenate(
            [friction * by_normal - by_friction, friction * by_normal + by_friction, self.normal]
        )
        return float((reserve / np.linalg.norm(slope, axis=1)).min())


def grip_response(
    statics: ContactStatics, state: ContactForces, wrench: Array, closure: ContactClosure
) -> GripResponse | None:
    """
    Return how pose and forces of a held object answer while the contacts stick.

    :param statics: the equations.
    :param state: the equilibrium.
    :param wrench: (fx, fy, m / arm) in it [N].
    :param closure: `stick` for its anchors.
    :return: None where the equilibrium is indifferent: its Jacobian is singular.
    """
    places, count = statics.places, len(statics.owners)
    _, jacobian, _ = statics.equations(state.unknowns, wrench, closure)
    members = int(statics.owners[-1]) + 1
    right = np.zeros((places.size, 4 + members))
    right[places.balance, :3] = -np.eye(3)
    own = np.eye(members)[statics.owners]
    moving = np.column_stack([_opening(statics, state), own * state.normals[:, None]])
    moved = statics.compliance.axis.conj()[:, None] * moving
    right[: 2 * count, 3:] = -np.concatenate([moved.real, moved.imag])
    try:
        change = np.linalg.solve(jacobian, right)
        np.linalg.inv(change[:3, :3])
    except np.linalg.LinAlgError:
        return None
    return GripResponse(
        change[:3, :3],
        change[places.normal, :3],
        change[places.friction, :3],
        change[places.normal, 3],
        own.T @ change[places.normal, 4:],
        state,
        statics.owners,
        statics.arm,
    )


def _opening(statics: ContactStatics, state: ContactForces) -> Points:
    """Return how the contacts move as the members move apart at 1 m/s, (k,) x + iy [-]."""
    owners = statics.owners
    if owners[-1] > 1:
        return 0.5 * state.normals
    compliance = statics.compliance
    touched = compliance.start + compliance.axis * state.feet - statics.tube_radius * state.normals
    apart = touched[owners == 1].mean() - touched[owners == 0].mean()
    return np.where(owners == 1, 0.5, -0.5) * apart / abs(apart)
