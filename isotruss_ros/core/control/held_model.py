# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The model of a held object in the loop."""

from __future__ import annotations

from dataclasses import dataclass, replace

from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.contact_statics import TubeModel
from isotruss_ros.core.holding.held_grip import HeldGrip, HoldStatus, travel_rates
from isotruss_ros.core.holding.roll_grip import roll_contacts
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import find_members, Grip
from isotruss_ros.core.numerics.arrays import Array


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """
    How a held object answers to a small wrench (fx, fy, m / arm) [N], and to the grip's opening.

    :ivar pose: (3, 3) displacement of (x, y, angle) [m/N, rad/N].
    :ivar squeeze: (3,) change of the mean normal force of the members [-].
    :ivar slope: change of the squeeze as the grip opens, negative [N/m].
    :ivar slip_margin: see `SettledGrasp.slip_margin` [N].
    """

    pose: Array
    squeeze: Array
    slope: float
    slip_margin: float


def attach_model(
    config: Configuration, grip: Grip, pressures: tuple[float, ...] | None = None
) -> HeldGrip | HoldStatus:
    """
    Return the equilibrium near the measured pose, or why there is none.

    :param config: where the robot is.
    :param grip: its object is where it was measured.
    :param pressures: (t,) gauge, by tube [Pa]; those of the robot file if None.
    :raises GraspError: no such members.
    :raises StructureError: see `structure_of`.
    """
    members = find_members(config.robot, grip.members).members
    tubes = TubeModel(pressure=pressures)
    return attach_grip(config, grip.body, members, tubes=tubes, quick=True)


def sensitivity(grasp: HeldGrip, friction: float) -> Sensitivity | None:
    """
    Return how a held object answers; None where its equilibrium is indifferent.

    :param grasp: how the object is held.
    :param friction: coefficient between tube and object.
    """
    response = grasp.response
    if response is None:
        return None
    margin = grasp.slip_margin(friction)
    return Sensitivity(response.pose, response.squeeze, grasp.squeeze_stiffness(), margin)


def move_zeros(grasp: HeldGrip, moved: Array) -> HeldGrip | None:
    """
    Return the equilibrium where zeros of the rollers are corrected; None where there is none.

    What is corrected did not roll: the anchors move along, so that the contacts stay.

    :param grasp: how the object is held before that.
    :param moved: (r,) by which the positions of the rollers change [m].
    """
    config = grasp.config.moved_to(grasp.config.roller_positions + moved)
    travel = travel_rates(config, grasp.contacts.members) @ moved
    anchors = grasp.anchors + grasp.statics.sides * travel
    found = roll_contacts(grasp, config, grasp.contacts, anchors, grasp.angles, grasp.wrench)
    return None if found is None else replace(found, motion=grasp.motion)
