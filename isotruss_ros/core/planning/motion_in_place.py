# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Motion in place: the squeeze of a held object changes while its pose stays.

The object is held and the contacts roll, by the mechanics of the elastic plant; Newton steps of
the rollers bring squeeze and place to what is wanted.
"""

from __future__ import annotations

import math

from isotruss_ros.core.errors import ConfigurationError, GraspError
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.solve_twist import RollerCommand, solve_twist
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.planning.closing import Closing, evaluate_state
from isotruss_ros.core.planning.grasp_plan import closer_violation, Violation
import numpy as np

#: Newton steps with which a waypoint is brought to its squeeze and place ...
MAX_CORRECTIONS = 12
#: ... until the squeeze is right to this share, the place to this length [m], the angle [rad].
SQUEEZE_TOLERANCE, PLACE_TOLERANCE, TURN_TOLERANCE = 1e-3, 2e-5, 1e-3
#: A command that limits scale down by more than this is not followed.
MIN_SCALE = 0.999


class MotionInPlace:
    """
    Changes the squeeze, and keeps account of what did not work.

    :ivar closing: the grip, where the object is to stay, and the bounds of the motion.
    :ivar evaluations: configurations that were computed so far.
    :ivar closest_violation: the violation of the best state so far.
    :param closing: the grip, where the object is to stay, and the bounds of the motion.
    """

    def __init__(self, closing: Closing) -> None:
        self.closing = closing
        self.evaluations = 0
        self.closest_violation: Violation | None = None

    def record(self, violation: Violation) -> None:
        """
        Keep a violation if it is the closest one.

        :param violation: of a state that is no grasp.
        """
        self.closest_violation = closer_violation(self.closest_violation, violation)

    def squeeze(self, grasp: HeldGrip, force: float) -> HeldGrip | None:
        """
        Return the grasp with another squeeze, the object where it lay.

        :param grasp: how the object is held.
        :param force: mean normal force of the members, positive [N].
        :return: None where there is none; then see `closest_violation`.
        :raises SolverError: a quadratic program was not solved.
        :raises StructureError: see `structure_of`.
        """
        scale, reachable = 1.0, True
        place = self.closing.body.pose
        center = np.array(place[:2])
        for _ in range(MAX_CORRECTIONS):
            away = center - grasp.pose[:2]
            missing = force - grasp.squeeze
            right = abs(missing) < SQUEEZE_TOLERANCE * force
            turn = math.remainder(place.angle - grasp.pose.angle, 2.0 * math.pi)
            # What has been turned is to come back if it can.
            turned = reachable and abs(turn) > TURN_TOLERANCE
            if right and np.hypot(*away) < PLACE_TOLERANCE and not turned:
                return grasp
            # The scale knows large steps: where only the place is left, it would overshoot.
            rate = 0.0 if right else scale * missing / grasp.squeeze_stiffness()
            command = self._command(grasp, np.append(away, turn), rate)
            reachable = command is not None and command.status is not Status.UNREACHABLE
            if command is None or command.scale < MIN_SCALE:
                self.record(Violation('squeeze', grasp.squeeze, force, 5.0))
                return None
            moved = self.move(grasp, command.roller_velocities)
            if moved is None:
                return None
            gained = moved.squeeze - grasp.squeeze
            if not right and gained * missing > 0.0:
                scale = float(np.clip(scale * missing / gained, 0.5, 2.0))
            grasp = moved
        # A robot of few rollers cannot close and keep the object in place: it goes along a little.
        diameter = grasp.config.robot.description.tube_diameter
        along = self.closing.settings.max_displacement * diameter
        bound = PLACE_TOLERANCE if reachable else along
        distance = float(np.hypot(*(center - grasp.pose[:2])))
        if abs(force - grasp.squeeze) >= SQUEEZE_TOLERANCE * force:
            self.record(Violation('squeeze', grasp.squeeze, force, 5.0))
        elif distance > bound:
            self.record(Violation('in_place', distance, bound, 20.0))
        else:
            return grasp
        return None

    def open_grip(self, grasp: HeldGrip, distance: float) -> Configuration | None:
        """
        Return the configuration in which the grip is open by so much more, the object in place.

        Members that merely moved away would roll the object along as long as they touch it.

        :param grasp: how the object is held, by a small squeeze.
        :param distance: by which the members open, see `solve_twist` [m].
        :return: None where limits end the motion; then see `closest_violation`.
        :raises SolverError: a quadratic program was not solved.
        """
        self.evaluations += 1
        command = self._command(grasp, np.zeros(3), distance)
        before = grasp.config
        if command is None or command.scale < MIN_SCALE:
            self.record(Violation('squeeze', grasp.squeeze, 0.0, 5.0))
            return None
        try:
            return before.moved_to(before.roller_positions + command.roller_velocities)
        except ConfigurationError:
            self.record(Violation('rigidity', 0.0, self.closing.min_rigidity, 50.0))
            return None

    def _command(self, grasp: HeldGrip, back: Array, rate: float) -> RollerCommand | None:
        """Return the motion that closes the grip and brings the object back, if there is one."""
        held, limits = Grip(grasp.member_names, grasp.body), self.closing.limits
        # A grip at a passive module cannot turn the object: its place is what counts.
        for twist in (back, np.append(back[:2], 0.0)):
            try:
                command = solve_twist(grasp.config, held, twist, limits=limits, opening_rate=rate)
            except GraspError:
                return None  # a member is deeper in the object than its tube is thick
            if command.status is not Status.UNREACHABLE:
                break
        return command

    def move(self, grasp: HeldGrip, travel: Array) -> HeldGrip | None:
        """
        Return the grasp after a motion of the rollers; None where a requirement is violated.

        :param grasp: how the object is held.
        :param travel: (r,) of the rollers [m].
        :raises StructureError: see `structure_of`.
        """
        self.evaluations += 1
        closing, before = self.closing, grasp.config
        try:
            config = before.moved_to(before.roller_positions + travel)
        except ConfigurationError:
            self.record(Violation('rigidity', 0.0, closing.min_rigidity, 50.0))
            return None
        moved = roll_grip(grasp, config)
        if moved is None:
            self.record(Violation('held', 0.0, 1.0, 10.0))
            return None
        state = evaluate_state(config, moved.body)
        gaps = np.delete(state.gaps, closing.members)
        values = {
            'rigidity': (state.rigidity, closing.min_rigidity),
            'self_clearance': (state.clearance, 0.0),
            'object_clearance': (float(gaps.min()), 0.0),
        }
        for name, (value, bound) in values.items():
            if value < bound:
                self.record(Violation(name, value, bound, 50.0))
                return None
        return moved
