# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A cylinder held between the two grasping members at one module.

The grasp frame has its origin at B and its x axis along the member B -> B'. The object is at rest
in that frame, except for rolling. Points of the plane are complex numbers, as in `constraints`.
"""

from __future__ import annotations

from dataclasses import dataclass
import functools
import math
from typing import NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.model.objects import Cylinder, Pose
from isotruss_ros.core.numerics.arrays import Array


@dataclass(frozen=True)
class Grasp:
    """
    Where the robot holds an object.

    :ivar module: name `t/j` of the module whose two grasping members hold the object.
    :ivar center: the object's centre (x, y) in the robot frame [m].
    :ivar diameter: the object's own diameter d [m].
    :raises GraspError: the centre is not two finite numbers, the diameter is not positive, or
        either is out of range.
    """

    module: str
    center: tuple[float, float]
    diameter: float

    # The module is checked against a robot when the grasp is used.
    __post_init__ = Cylinder.__post_init__


class GraspingMembers(NamedTuple):
    """
    The two members that meet at a grip module, in one configuration.

    :ivar index: number of the module.
    :ivar nodes: numbers of the nodes B, B', C, C'.
    :ivar ahead: B' - B in the robot frame [m].
    :ivar back: C' - C in the robot frame [m].
    :ivar side: +1 where the space between the members is left of B -> B', -1 where it is right.
    """

    index: int
    nodes: tuple[int, int, int, int]
    ahead: complex
    back: complex
    side: float


def module_index(robot: Robot, name: str) -> int:
    """
    Return the number of a module.

    :param robot: the robot.
    :param name: name `t/j` of the module.
    :raises GraspError: the robot has no such module.
    """
    try:
        return robot.module_names.index(name)
    except ValueError:
        raise GraspError(
            f'module {name!r}: robot {robot.name} has no such module; '
            f'its modules are {", ".join(robot.module_names)}'
        ) from None


@functools.lru_cache(maxsize=1024)
def nodes_at_module(robot: Robot, name: str) -> tuple[int, tuple[int, int, int, int]]:
    """
    Return the number of a module, and of the nodes B, B', C, C' of the two members there.

    :param robot: the robot.
    :param name: name `t/j` of the module.
    :raises GraspError: the robot has no such module.
    """
    i, topology = module_index(robot, name), robot.topology
    b, c = topology.b, topology.c
    ahead, back = int(topology.following[i]), int(topology.previous[i])
    return i, (int(b[i]), int(c[ahead]), int(c[i]), int(b[back]))


@functools.lru_cache(maxsize=1024)
def find_roller(robot: Robot, name: str) -> int | None:
    """
    Return the number of the roller of a module, None where that is passive.

    :param robot: the robot.
    :param name: name `t/j` of the module.
    """
    return robot.roller_names.index(name) if name in robot.roller_names else None


@functools.lru_cache(maxsize=4)  # a cycle asks several times for the same two shapes
def members_at_module(config: Configuration, module: str) -> GraspingMembers:
    """
    Find the two members that meet at a module.

    :param config: configuration of the robot.
    :param module: name `t/j` of the module.
    :raises GraspError: the robot has no such module.
    """
    i, nodes = nodes_at_module(config.robot, module)
    b, b_next, c, c_prev = map(config.points.item, nodes)
    ahead, back = b_next - b, c_prev - c
    side = 1.0 if (ahead.conjugate() * back).imag > 0.0 else -1.0
    return GraspingMembers(i, nodes, ahead, back, side)


def find_grasping_members(config: Configuration, grasp: Grasp) -> GraspingMembers:
    """
    Find the two members that hold the object.

    :param config: configuration of the robot.
    :param grasp: the grasp.
    :raises GraspError: no such module, or the object is not between its two members.
    """
    members = members_at_module(config, grasp.module)
    b, _, c, _ = members.nodes
    center = complex(*grasp.center)
    left_of_ahead = (members.ahead.conjugate() * (center - config.points.item(b))).imag
    left_of_back = (members.back.conjugate() * (center - config.points.item(c))).imag
    if not (left_of_ahead * members.side > 0.0 and left_of_back * members.side < 0.0):
        raise GraspError(
            f'the object at ({center.real:.4g}, {center.imag:.4g}) m is not between the two '
            f'members that meet at module {grasp.module}; name the module that holds it, '
            'or give the centre in the robot frame'
        )
    return members


def check_members_are_near(config: Configuration, grasp: Grasp) -> None:
    """
    Check that both grasping members are near the object: within a tube's diameter of touching it.

    An object can be between the lines of two members that do not hold it. Members of another
    module than the one that holds the object are farther off than any grip that just opened.

    :param config: configuration of the robot.
    :param grasp: the grasp.
    :raises GraspError: no such module, the object is not between its two members, or one of them
        is too far off; names the module.
    """
    members, center = find_grasping_members(config, grasp), complex(*grasp.center)
    tube = config.robot.description.tube_diameter
    reach = 0.5 * (grasp.diameter + tube)
    starts = (config.points[members.nodes[0]], config.points[members.nodes[2]])
    gaps = [
        _distance(center, complex(start), span) - reach
        for start, span in zip(starts, (members.ahead, members.back), strict=True)
    ]
    if max(gaps) > tube:
        raise GraspError(
            f'module {grasp.module} does not hold the object at '
            f'({center.real:.4g}, {center.imag:.4g}) m: the gaps to its two members are '
            f'{gaps[0]:.3g} m and {gaps[1]:.3g} m, at most {tube:.3g} m in a grip; name the '
            'module that holds it'
        )


def _distance(point: complex, start: complex, span: complex) -> float:
    """Return the distance of a point from the line segment from start to start + span [m]."""
    along = ((span.conjugate() * (point - start)).real) / abs(span) ** 2
    return abs(point - start - min(1.0, max(0.0, along)) * span)


@dataclass(frozen=True)
class HeldObject:
    """
    An object at rest in the grasp frame, except for rolling.

    Its pose is a function of the node positions and the roller travel, so that nothing drifts.

    :ivar grasp: the grasp at the time when it was closed.
    :ivar local: the object's centre in the grasp frame [m].
    :ivar offset: the object's angle minus that of the grasp frame and of the rolling [rad].
    """

    grasp: Grasp
    local: complex
    offset: float

    @classmethod
    def attach(cls, config: Configuration, grasp: Grasp, angle: float = 0.0) -> HeldObject:
        """
        Close the grip around an object.

        :param config: configuration of the robot.
        :param grasp: the grasp; its centre is that of the object.
        :param angle: the object's orientation in the robot frame [rad].
        :raises GraspError: no such module, or the object is not between its two members.
        """
        members = find_grasping_members(config, grasp)
        axis = members.ahead / abs(members.ahead)
        turned = math.atan2(axis.imag, axis.real) + _rolled(config, members, grasp)
        arm = complex(*grasp.center) - complex(config.points[members.nodes[0]])
        return cls(grasp, arm / axis, angle - turned)

    def pose(self, config: Configuration) -> Pose:
        """
        Return the object's pose in the robot frame; the angle is in (-pi, pi].

        :param config: configuration of the robot.
        """
        members = members_at_module(config, self.grasp.module)
        axis = members.ahead / abs(members.ahead)
        center = complex(config.points[members.nodes[0]]) + axis * self.local
        turned = math.atan2(axis.imag, axis.real) + _rolled(config, members, self.grasp)
        angle = math.remainder(self.offset + turned, 2.0 * math.pi)
        return Pose(center.real, center.imag, angle)

    def follow(self, config: Configuration) -> None:
        """
        Stay at rest in the grip: the pose is a function of the configuration.

        :param config: configuration of the robot.
        """

    def come_to_rest(self, config: Configuration) -> None:
        """
        Stay in the grip; part of the interface of simulated objects.

        :param config: configuration of the robot.
        """

    def grasp_in(self, config: Configuration) -> Grasp:
        """
        Return the grasp with the object's centre in another configuration.

        :param config: configuration of the robot.
        """
        return Grasp(self.grasp.module, self.pose(config)[:2], self.grasp.diameter)


def predict_grasp(
    config: Configuration, grasp: Grasp, angle: float, before: Array, travel: Array
) -> tuple[Configuration, Grasp, float]:
    """
    Predict configuration, grasp and the object's angle after some roller travel.

    :param config: configuration when the rollers were measured.
    :param grasp: the grasp when the object was measured.
    :param angle: of the object then [rad].
    :param before: (r,) roller travel from the measurement of the rollers to that of the object
        [m].
    :param travel: (r,) roller travel from the measurement of the rollers on [m].
    :return: configuration, grasp and angle after `travel`.
    :raises GraspError: no such module, or the object is not between its two members.
    :raises ConfigurationError: there is no such configuration.
    """
    measured = config.predict(before) if before.any() else config
    held = HeldObject.attach(measured, grasp, angle)
    predicted = config.predict(travel)
    *center, angle = held.pose(predicted)
    return predicted, Grasp(grasp.module, tuple(center), grasp.diameter), angle


def _rolled(config: Configuration, members: GraspingMembers, grasp: Grasp) -> float:
    """Return the angle by which the object has rolled since home [rad]: (17) integrated."""
    place = find_roller(config.robot, grasp.module)
    if place is None:
        return 0.0
    return members.side * 2.0 * float(config.roller_positions[place]) / grasp.diameter
