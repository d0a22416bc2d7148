# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The rows of a grip on the roller speeds: the constraint of its contacts, solved for the twist.

Contacts roll, see `grip_contacts`. For a cylinder between the two members of one module the rows
are those of (14) to (18).
"""

from __future__ import annotations

from collections.abc import Sequence
import functools

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.grip import find_members, Grip, Touch, touch_members
from isotruss_ros.core.manipulation.grip_contacts import ONE_POINT, rows_of_three
from isotruss_ros.core.model.pose import MIN_DIAMETER
from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np


@functools.lru_cache(maxsize=8)
def grip_jacobian(config: Configuration, grip: Grip) -> Array:
    """
    Return the map from roller speeds to the motion of an object in a grip: (19) after (12).

    The first three rows solve J_h(q) qdot = G^T nu for the twist, the others are what is left of
    it: a motion keeps the contacts where they are zero. The last few maps are kept.

    :param config: configuration of the robot.
    :param grip: the grip.
    :return: (3 + g, r) for 1 m/s at each roller, robot frame: rows vx, vy [m/s] and omega [rad/s]
        of the object, then the rate of the distance between two members where they touch, or twice
        that with which each of three moves away from the object, and g - 1 other rows, all [m/s];
        g is 1 for two members that touch in a point, 2 where a face lies on one of them, 3 where
        faces lie on both, and 2 k - 3 for k contacts of three members. Not to be written to.
    :raises GraspError: see `find_contacts`; or the contacts are all in one point.
    :raises ConfigurationError: the configuration is singular.
    """
    if len(grip.members) == 2:
        jacobian = rows_of_two(config, grip, touch_members(config, grip))
    else:
        jacobian = rows_of_three(config, grip)
    jacobian.flags.writeable = False
    return jacobian


def rows_of_two(config: Configuration, grip: Grip, touches: Sequence[Touch]) -> Array:
    """
    Return `grip_jacobian` of two members, some contacts of which may have been left out.

    In place of solving the constraint, `hand_jacobian` and `grasp_map`, for the twist.

    :param config: configuration of the robot.
    :param grip: of two members.
    :param touches: where they touch the object.
    :raises GraspError: the contacts are in one point.
    :raises ConfigurationError: the configuration is singular.
    """
    first, *one = (touch for touch in touches if touch.owner == 0)
    second, *other = (touch for touch in touches if touch.owner == 1)
    points = _middle(first, one), _middle(second, other)
    # (19): velocity (15) and turning (18) of the object, then the distance of the contacts, which
    # for a disc at a module is constant where the angle (14) is.
    rates = _rates_of_two(grip, points, (bool(one), bool(other)))
    # The material moves with the member's start, turns with the member (16), and moves along it
    # with the roller, by which the object rolls (17).
    (lever, turn, back), (other_lever, other_turn, other_back) = (
        ((point - at.start).conjugate(), 1j / at.span.conjugate(), at.axis.conjugate())
        for at, point in zip((first, second), points, strict=True)
    )
    entries: list[complex] = []
    rolls: tuple[list[float], list[float]] = ([], [])
    for h, other_h, k, other_k in rates:
        turned = ((h * lever).imag + k) * turn
        other_turned = ((other_h * other_lever).imag + other_k) * other_turn
        entries += (h - turned, other_h - other_turned, turned, other_turned)
        rolls[0].append((h * back).real)
        rolls[1].append((other_h * other_back).real)
    by_node = np.zeros(len(rates) * len(config.points), dtype=np.complex128)
    by_node[_entry_places(config.robot, grip.members, len(rates))] = entries
    jacobian = config.roller_rows(by_node.view(np.float64).reshape(len(rates), -1))
    nodes = find_members(config.robot, grip.members)
    for member, roller in zip(nodes.driven.tolist(), nodes.rollers.tolist(), strict=True):
        jacobian[:, roller] += rolls[member]
    return jacobian


@functools.lru_cache(maxsize=256)
def _entry_places(robot: Robot, members: tuple[str, ...], count: int) -> Indices:
    """Return where the entries of so many rows on the members' nodes are, row after row."""
    nodes = find_members(robot, members).both
    return (robot.topology.n_nodes * np.arange(count)[:, None] + nodes).ravel()


def _middle(first: Touch, others: list[Touch]) -> complex:
    return 0.5 * (first.point + others[0].point) if others else first.point


def _rates_of_two(
    grip: Grip, points: tuple[complex, complex], faces: tuple[bool, bool]
) -> list[tuple[complex, complex, float, float]]:
    """
    Return the rows of `grip_jacobian` on the motion of two members, touched at points.

    Each is h1, h2, k1, k2 of Re(conj(h1) v1 + conj(h2) v2) + k1 w1 + k2 w2, with the velocities v
    of the material at the points and the turning rates w of the members. Where a face lies on a
    member the object turns with it, else with the line through both; their middle moves with both.
    """
    apart = points[1] - points[0]
    distance = abs(apart)
    if distance < MIN_DIAMETER:
        raise GraspError(ONE_POINT)
    along = apart / distance
    across, around, one, other = 1j * along, 0j, 0.0, 0.0
    kept: list[tuple[complex, complex, float, float]] = [(-along, along, 0.0, 0.0)]
    if any(faces):
        one, other = (1.0, 0.0) if faces[0] else (0.0, 1.0)
        kept.append((-across, across, -distance * one, -distance * other))
        if all(faces):
            kept.append((0j, 0j, -grip.body.arm, grip.body.arm))
    else:
        around = across / distance
    # From the middle of both to the object's origin.
    arm = grip.body.center - 0.5 * (points[0] + points[1])
    up, right = arm.imag, arm.real
    return [
        (0.5 + up * around, 0.5 - up * around, -up * one, -up * other),
        (0.5j - right * around, 0.5j + right * around, right * one, right * other),
        (-around, around, one, other),
        *kept,
    ]
