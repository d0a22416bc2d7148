# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Closing in place: members press on a free object, which stays where it is.

Two members face it so that friction holds it as soon as both press. From there on it is held and
the contacts roll: the squeeze rises while the twist of the object is zero. The path is what the
rollers do then, by the mechanics of the elastic plant. A path for an object that the ground holds
would drag a free one along, by several centimetres.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
import math

from isotruss_ros.core.contact.analyze_grasp import analyze_grasp
from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.hold_status import HoldStatus
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.planning.closed_grip import ClosedGrip
from isotruss_ros.core.planning.closing import Closing, outward_normals
from isotruss_ros.core.planning.closing_motion import press
from isotruss_ros.core.planning.facing import contact_ends
from isotruss_ros.core.planning.force_bounds import exceeded_bound, grasp_loads
from isotruss_ros.core.planning.grasp_plan import Violation
from isotruss_ros.core.planning.motion_in_place import MotionInPlace, SQUEEZE_TOLERANCE
from isotruss_ros.core.planning.requirements import GraspRequirements, rate_grasp
from isotruss_ros.core.planning.surrounding import squeeze_around
import numpy as np

#: An object that is nearer than this to where it lay has stayed there [m].
SAME_PLACE = 1e-4
#: So often the depths of three members are corrected until the object stays there.
MAX_BALANCE_STEPS = 4


class ClosingInPlace:
    """
    Searches the squeeze with which members hold a free object, and the path to it.

    :ivar analyses: analyses so far.
    :param opened: configuration in which the members are close to the object.
    :param closing: what closes.
    :param requirements: what the grasp must fulfil.
    """

    def __init__(
        self, opened: Configuration, closing: Closing, requirements: GraspRequirements
    ) -> None:
        self._open, self._needs = opened, requirements
        # A nominal posture would keep the gaps from their targets, by a little.
        self._closing = replace(closing, nominal_posture=None, facing=None)
        self._motion = MotionInPlace(self._closing)
        self.analyses = 0

    @property
    def evaluations(self) -> int:
        """Return how many configurations were computed so far."""
        return self._motion.evaluations

    @property
    def closest_violation(self) -> Violation | None:
        """Return the violation of the best state so far."""
        return self._motion.closest_violation

    def close(self) -> ClosedGrip | None:
        """
        Return a grip that fulfils the requirements, or None; then see `closest_violation`.

        :raises SolverError: a quadratic program, or the contact, was not solved.
        :raises StructureError: see `structure_of`.
        """
        touch = self._press(self._open, np.zeros(len(self._closing.members)))
        if touch is None:
            return None
        needs, path = self._needs, [touch]
        best, best_score = None, -math.inf
        for grasp in self._rise(touch):
            path.append(grasp.config)
            self.analyses += 1
            body = self._placed(grasp)
            analysis = analyze_grasp(grasp.config, body, needs.friction, needs.external_wrench)
            loads = grasp_loads(analysis, grasp)
            over = exceeded_bound(needs, loads)
            if over is not None:
                self._motion.record(over)
                break
            if needs.squeeze is not None and not _reached(grasp, needs.squeeze):
                continue
            margin = self._require(grasp, analysis)
            if margin is None:
                continue
            # The path as far as here is shorter than all of it.
            score = rate_grasp(needs, analysis, loads.max_total_force, margin, -grasp.squeeze)
            if score <= best_score:
                break
            best_score = score
            best = (path[:], body, analysis, loads, grasp.squeeze, margin)
        return None if best is None else ClosedGrip.at_end(*best)

    def _rise(self, touch: Configuration) -> Iterator[HeldGrip]:
        """Yield how the object is held with larger and larger squeeze, until it is that wanted."""
        settings, wanted = self._closing.settings, self._needs.squeeze
        closer = settings.closing_step * touch.robot.description.tube_diameter
        pair = len(self._closing.members) == 2
        first = grasp = self._hold(touch)
        while grasp is not None and self._sticks(grasp):
            # Two members bring the object back to its place with the next step only.
            if not (pair and grasp is first):
                yield grasp
            if wanted is not None and _reached(grasp, wanted):
                return
            force = grasp.squeeze - closer * grasp.squeeze_stiffness()
            if not pair:
                force = min(
                    grasp.squeeze * settings.squeeze_growth, grasp.squeeze + settings.squeeze_rise
                )
            force = force if wanted is None else min(wanted, force)
            if pair:
                grasp = self._motion.squeeze(grasp, force)
            else:
                grasp = squeeze_around(self._motion, grasp, force)

    def _hold(self, touch: Configuration) -> HeldGrip | None:
        """Return how the object is held first; three members press as deep as keeps it there."""
        body, members = self._closing.body, np.array(self._closing.members)
        settings, tube = self._closing.settings, touch.robot.description.tube_diameter
        one, other = contact_ends(body, outward_normals(touch, self._closing))
        depth = settings.first_contact if (one == other).all() else settings.face_contact
        config, depths = touch, np.full(len(members), depth * tube)
        for _ in range(MAX_BALANCE_STEPS):
            pressed = self._press(config, depths)
            if pressed is None:
                return None
            config, found = pressed, attach_grip(pressed, body, members)
            if isinstance(found, HoldStatus):
                self._motion.record(Violation('held', 0.0, 1.0, 30.0))
                return None
            away = found.body.center - body.center
            if len(members) == 2 or abs(away) < SAME_PLACE:
                break
            normals = outward_normals(config, self._closing)
            depths = np.maximum(depths + (away * normals.conj()).real, 0.0)
        return found

    def _sticks(self, grasp: HeldGrip) -> bool:
        """Return whether the contacts stick."""
        friction = self._needs.friction
        hold = grasp.hold(friction)
        if hold is HoldStatus.SLIPS:
            needed = grasp.required_friction
            self._motion.record(
                Violation('force_closure', needed, friction, 1.0 - friction / needed)
            )
        elif hold is not HoldStatus.HELD:
            self._motion.record(Violation('held', 0.0, 1.0, 10.0))
        return hold is HoldStatus.HELD

    def _require(self, grasp: HeldGrip, analysis: GraspAnalysis) -> float | None:
        """Return the slip margin of a grip [N], None if it does not bear what it must."""
        needs = self._needs
        loaded = roll_grip(grasp, grasp.config, np.array(needs.external_wrench))
        if loaded is None:
            self._motion.record(Violation('held', 0.0, 1.0, 2.0))
            return None
        if not self._sticks(loaded):
            return None
        names = grasp.config.robot.member_names
        if set(analysis.contact_forces) != {names[i] for i in self._closing.members}:
            # Friction deflects a soft structure by so much that without it one member lets go.
            count = float(len(self._closing.members))
            self._motion.record(Violation('grip', len(analysis.contact_forces), count, 15.0))
            return None
        margin, fast = loaded.slip_margin(needs.friction), analysis.closure_margin
        if margin < needs.min_slip_margin:
            distance = 1.0 - margin / needs.min_slip_margin
            self._motion.record(
                Violation('min_slip_margin', margin, needs.min_slip_margin, distance)
            )
            return None
        if needs.min_margin is not None and fast < needs.min_margin:
            distance = 1.0 - max(0.0, fast) / needs.min_margin if needs.min_margin else 1.0
            self._motion.record(Violation('min_margin', fast, needs.min_margin, distance))
            return None
        return margin

    def _placed(self, grasp: HeldGrip) -> ConvexObject:
        """Return the object where it is: where it lay, if it stayed there."""
        lay = self._closing.body
        moved = np.subtract(grasp.pose, lay.pose)
        moved[2] = lay.arm * math.remainder(moved[2], 2.0 * math.pi)
        return lay if np.abs(moved).max() < SAME_PLACE else lay.moved_to(grasp.pose)

    def _press(self, config: Configuration, depths: Array) -> Configuration | None:
        """Return the configuration with an indentation of each member, or None."""
        pressed = press(config, self._closing, depths)
        self._motion.evaluations += pressed.evaluations
        if pressed.violation is not None:
            self._motion.record(pressed.violation)
        return pressed.config


def _reached(grasp: HeldGrip, squeeze: float) -> bool:
    return grasp.squeeze >= (1.0 - 2.0 * SQUEEZE_TOLERANCE) * squeeze
