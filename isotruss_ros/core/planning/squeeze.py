# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The second step of the search for an object that the ground holds: how deep each member is.

It lies where it is, as in the paper. Members hold it between them only where their forces balance,
so one is indented more and the other less until friction balances the rest (Newton's method, with
secant updates of the slopes). Then the mean indentation is adapted to the required margin and
forces.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from isotruss_ros.core.contact.analyze_grasp import analyze_grasp
from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis
from isotruss_ros.core.holding.settle_grasp import settle_grasp, SettledGrasp
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.planning.closed_grip import ClosedGrip
from isotruss_ros.core.planning.closing import Closing
from isotruss_ros.core.planning.closing_motion import GAP_TOLERANCE, press
from isotruss_ros.core.planning.force_balance import find_imbalance, Imbalance
from isotruss_ros.core.planning.force_bounds import exceeded_bound, grasp_loads, GraspLoads
from isotruss_ros.core.planning.grasp_plan import closer_violation, Violation
from isotruss_ros.core.planning.requirements import GraspRequirements
import numpy as np


@dataclass(frozen=True, eq=False)
class Pressed:
    """
    A grip that holds the object.

    :ivar config: configuration of the robot.
    :ivar analysis: of it, the object held fast.
    :ivar settled: equilibrium of the object, were it free.
    :ivar loads: of the object held fast; the tubes bear the larger moment of both.
    :ivar depths: (s,) indentation of each grasping member [m].
    """

    config: Configuration
    analysis: GraspAnalysis
    settled: SettledGrasp
    loads: GraspLoads
    depths: Array


class Squeeze:
    """
    Searches the indentations at which the members of one grip hold the object.

    :ivar evaluations: configurations that were computed so far.
    :ivar analyses: analyses so far.
    :ivar closest_violation: the violation of the best candidate so far.
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
        self.evaluations = self.analyses = 0
        self.closest_violation: Violation | None = None

    def search(self) -> Pressed | None:
        """
        Return a grip that fulfils the requirements, or None; then see `closest_violation`.

        :raises SolverError: a quadratic program, or the contact, was not solved.
        """
        diameter = self._open.robot.description.tube_diameter
        settings = self._closing.settings
        depth = settings.first_depth * diameter
        low, high = (share * diameter for share in settings.depth_range)
        shares = np.ones(len(self._closing.members))
        for _ in range(settings.max_depths):
            found, factor = self._balance(depth, shares)
            if found is not None:
                return found
            # Only indentations between one that is too small and one that is too large remain.
            low, high = (depth, high) if factor > 1.0 else (low, depth)
            rest = 0.1 * (high - low)
            depth = float(np.clip(factor * depth, low + rest, high - rest))
            if high < 1.1 * low:
                break
        return None

    def close(self) -> ClosedGrip | None:
        """
        Return a grip that fulfils the requirements, and the path to it, or None.

        :raises SolverError: a quadratic program, or the contact, was not solved.
        """
        pressed = self.search()
        path = () if pressed is None else self.closing_path(pressed)
        if pressed is None or not path:
            return None
        body = self._closing.body
        mean = float(pressed.analysis.normal_forces.sum()) / len(pressed.depths)
        margin = pressed.settled.slip_margin if pressed.settled.held else 0.0
        return ClosedGrip.at_end(path, body, pressed.analysis, pressed.loads, mean, margin)

    def closing_path(self, pressed: Pressed) -> tuple[Configuration, ...]:
        """
        Return the path from where all grasping members touch the object to the grasp.

        :param pressed: the grasp.
        :return: configurations along it; none where one of them is not admissible.
        """
        config, path = self._open, []
        for share in (0.0, 0.25, 0.5, 0.75):
            found = self.press(config, share * pressed.depths)
            if found is None:
                return ()
            config = found
            path.append(config)
        return (*path, pressed.config)

    def press(self, config: Configuration, depths: Array) -> Configuration | None:
        """
        Return the configuration with the given indentations, or None.

        :param config: where to begin.
        :param depths: (s,) indentation of each grasping member [m].
        """
        pressed = press(config, self._closing, depths)
        self.evaluations += pressed.evaluations
        if pressed.violation is not None:
            self._record(pressed.violation)
        return pressed.config

    def _balance(self, depth: float, shares: Array) -> tuple[Pressed | None, float]:
        """
        Balance the members at one mean indentation.

        :param shares: (s,) of the mean indentation, by member: where to begin.
        :return: the grip, and the factor on the mean indentation where there is none.
        """
        settings = self._closing.settings
        config, factor = self._open, settings.decrease
        free = np.linalg.svd(np.ones((1, len(shares))))[2][1:].T  # what leaves the mean as it is
        slope: Array | None = None
        last: tuple[Array, Array] | None = None
        for _ in range(settings.max_balance_steps):
            depths = depth * shares
            found = self.press(config, depths)
            if found is None:
                return None, settings.decrease
            config = found
            analysis, load, missing = self._analyze(config, depths)
            factor = missing[1]
            if missing[0] is None:
                return self._free(config, analysis, depths)
            if load is None:
                return None, settings.increase
            here = free.T @ depths
            if slope is None or last is None:
                slope = load.slope @ free
            else:
                moved, secant = here - last[0], load.load - last[1]
                slope = slope + np.outer(secant - slope @ moved, moved) / (moved @ moved)
            last = here, load.load
            move = np.linalg.lstsq(slope, -load.load, rcond=None)[0]
            size = float(np.abs(move).max())
            if size < 1e-3 * GAP_TOLERANCE:
                break
            shares = shares + free @ move * min(1.0, 0.5 * depth / size) / depth
            if shares.min() < 1.0 / settings.max_share or shares.max() > settings.max_share:
                return None, settings.decrease
        return None, factor

    def _analyze(
        self, config: Configuration, depths: Array
    ) -> tuple[GraspAnalysis, Imbalance | None, tuple[Violation | None, float]]:
        """Return the analysis of a grip, its imbalance, and violation and factor of `_missing`."""
        needs, closing = self._needs, self._closing
        self.analyses += 1
        analysis = analyze_grasp(config, closing.body, needs.friction, needs.external_wrench)
        left = find_imbalance(config, closing, analysis, needs.external_wrench, depths)
        missing = self._missing(analysis)
        if missing[0] is not None:
            self._record(missing[0])
        return analysis, left, missing

    def _free(
        self, config: Configuration, analysis: GraspAnalysis, depths: Array
    ) -> tuple[Pressed | None, float]:
        """Return a grip as `_balance` does, unless it wrinkles a tube once the object is free."""
        needs = self._needs
        settled = settle_grasp(config, self._closing.body, needs.friction, needs.external_wrench)
        loads = grasp_loads(analysis)
        if settled.hold.at_rest:
            used = max(loads.max_utilisation, *settled.utilisation.values())
            loads = loads._replace(max_utilisation=used)
        over = exceeded_bound(needs, loads)
        if over is None:
            return Pressed(config, analysis, settled, loads, depths), 1.0
        self._record(over)
        return None, 0.95 * over.bound / over.value

    def _missing(self, analysis: GraspAnalysis) -> tuple[Violation | None, float]:
        """Return the violation of an analysed grip, and the factor on its mean indentation."""
        needs, settings = self._needs, self._closing.settings
        total = float(analysis.normal_forces.sum())
        if total == 0.0:
            return Violation('force_closure', 0.0, 1.0, 30.0), settings.increase
        over = exceeded_bound(needs, grasp_loads(analysis))
        if over is not None:
            return over, 0.95 * over.bound / over.value
        friction, margin = analysis.required_friction, analysis.closure_margin
        if not analysis.force_closure or margin < 0.0:
            # Where the plane of friction is all but flat, more indentation widens the contact.
            large = friction > 3.0 * needs.friction
            factor = settings.increase if large else settings.decrease
            distance = 1.0 - margin / total
            return Violation('force_closure', friction, needs.friction, distance), factor
        least = needs.min_margin or 0.0
        if margin < least:
            short = 1.0 - margin / least
            return Violation('min_margin', margin, least, short), settings.increase
        return None, 1.0

    def _record(self, violation: Violation) -> None:
        self.closest_violation = closer_violation(self.closest_violation, violation)
