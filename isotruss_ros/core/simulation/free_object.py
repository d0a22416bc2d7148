# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A simulated object that lies free until the robot has closed around it."""

from __future__ import annotations

from collections.abc import Mapping
import math

from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.grasping.analysis import analyze_grasp
from isotruss_ros.core.grasping.held_members import Hold
from isotruss_ros.core.grasping.settle_grasp import settle_grasp
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grasp import Grasp, HeldObject
from isotruss_ros.core.model.objects import Cylinder, Pose
from isotruss_ros.core.safety.distances import object_gaps


class FreeObject:
    """
    An object that lies where it is, and goes with the grip once friction holds it.

    Whether it does is looked at whenever the rollers have come to rest: then the object moves to
    its equilibrium between the two members, and from there on it is at rest in the grip.
    Where no two sides of a module press on it any more, it lies free again. While it lies, the
    ground holds it: the model knows no pushing. A tube that would be indented by more than
    its own diameter lies on the object, and does not grip it.

    :param cylinder: the object, where it lies.
    :param friction: coefficient between tube and object.
    :param angle: its orientation in the robot frame [rad].
    """

    def __init__(self, cylinder: Cylinder, friction: float, angle: float = 0.0) -> None:
        self._diameter, self._friction = cylinder.diameter, friction
        self._lies = Pose(*cylinder.center, math.remainder(angle, 2.0 * math.pi))
        self._held: HeldObject | None = None

    @property
    def grip(self) -> str | None:
        """Return the module that holds it; None while it lies free."""
        return None if self._held is None else self._held.grasp.module

    def pose(self, config: Configuration) -> Pose:
        """
        Return its pose in a configuration; the angle is in (-pi, pi].

        :param config: configuration of the robot.
        """
        return self._lies if self._held is None else self._held.pose(config)

    def follow(self, config: Configuration) -> None:
        """
        Stay where it is, or at rest in the grip.

        :param config: configuration of the robot.
        """

    def come_to_rest(self, config: Configuration) -> None:
        """
        Find out, in a robot that stands still, whether the object is held.

        :param config: configuration of the robot.
        """
        pose = self.pose(config)
        lying = Cylinder((pose.x, pose.y), self._diameter)
        try:
            if self._held is not None:
                analysis = analyze_grasp(config, lying, self._friction)
                if grip_module(config, analysis.contact_forces) is None:
                    self._lies, self._held = pose, None
                return
            if object_gaps(config, lying).members.min() < -config.robot.description.tube_diameter:
                return
            settled = settle_grasp(config, lying, self._friction)
            held, forces, center = settled.hold.at_rest, settled.normal_forces, settled.pose[:2]
            if settled.hold is Hold.OTHER_CONTACT or len(forces) > 2:
                # Three members and more fix its place: it is held where it is, by (10).
                analysis = analyze_grasp(config, lying, self._friction)
                held, forces = analysis.force_closure, analysis.contact_forces
                center = lying.center
            module = grip_module(config, forces)
            if held and module is not None:
                grasp = Grasp(module, center, self._diameter)
                self._held = HeldObject.attach(config, grasp, pose.angle)
        except IsotrussError:
            return  # forces that cannot be computed hold nothing new, and let nothing go


def grip_module(config: Configuration, forces: Mapping[str, float]) -> str | None:
    """
    Return the module whose two sides press hardest on an object, the weaker one counts.

    :param config: configuration of the robot.
    :param forces: with which members press, by member [N].
    """
    robot = config.robot
    pressing = [forces.get(name, 0.0) for name in robot.member_names]
    weaker = [
        min(force, pressing[i]) for force, i in zip(pressing, robot.topology.previous, strict=True)
    ]
    hardest = max(range(len(weaker)), key=weaker.__getitem__)
    return robot.module_names[hardest] if weaker[hardest] > 0.0 else None
