# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""How a held object answers to small wrenches and to members that move: contacts stick."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.holding.balance import ContactForces
from isotruss_ros.core.holding.contact_closures import rolling_rows
from isotruss_ros.core.holding.contact_statics import ContactStatics
from isotruss_ros.core.holding.slip_margin import solve_change, WrenchResponse
from isotruss_ros.core.numerics.arrays import Array, Points
import numpy as np


@dataclass(frozen=True, eq=False)
class GripResponse(WrenchResponse):
    """
    What a small external wrench does to an object at k contacts, and what members do that move.

    :ivar opening: (k,) change of the normal forces as the members move apart [N/m].
    :ivar openings: (m, m) change of the members' normal forces as each of them moves away from the
        object [N/m].
    """

    opening: Array
    openings: Array

    @property
    def squeeze_stiffness(self) -> float:
        """Return the change of the mean normal force of the members as they move apart [N/m]."""
        return float(self.opening.sum()) / (int(self.owners[-1]) + 1)


def grip_response(statics: ContactStatics, state: ContactForces) -> GripResponse | None:
    """
    Return how pose and forces of a held object answer while the contacts stick.

    :param statics: the equations.
    :param state: the equilibrium.
    :return: None where the equilibrium is indifferent: its Jacobian is singular.
    """
    places, count = statics.places, len(statics.owners)
    members = int(statics.owners[-1]) + 1
    right = np.zeros((places.size, 4 + members))
    right[places.balance, :3] = -np.eye(3)
    own = np.eye(members)[statics.owners]
    moving = np.column_stack([_opening(statics, state), own * state.normals[:, None]])
    moved = statics.compliance.axis.conj()[:, None] * moving
    right[: 2 * count, 3:] = -np.concatenate([moved.real, moved.imag])
    rolling = rolling_rows(statics, state.unknowns, state.normals)
    change = solve_change(state.jacobian_with(rolling), right)
    if change is None:
        return None
    normal, friction = change[places.normal], change[places.friction]
    return GripResponse(
        change[:3, :3],
        normal[:, :3],
        friction[:, :3],
        statics.owners,
        statics.arm,
        normal[:, 3],
        own.T @ normal[:, 4:],
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
