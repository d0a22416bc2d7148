"""
The second step of the search: how hard each side of a grip is to press.

Two sides hold an object between them only where they press alike, so one is pressed deeper and
the other less until what friction cannot balance is gone (Newton, with secant updates of the
slopes). Then the mean depth is adapted to the margin and the forces that are asked for.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from isotruss_ros.core.balance import correction, Imbalance, imbalance
from isotruss_ros.core.closing import Closing, look_at
from isotruss_ros.core.closing_step import step
from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.grasp_analysis import analyze_grasp, GraspAnalysis
from isotruss_ros.core.grasp_plan import Miss
from isotruss_ros.core.requirements import GraspRequirements
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Spacings of the contact points [m]; a grasp must hold with each of them.
SPACINGS = (0.0025, 0.005, 0.00125)
#: How deep the sides press at first, at least and at most, against the tube's diameter.
FIRST_DEPTH, LEAST_DEPTH, MOST_DEPTH = 0.33, 0.03, 0.8
MAX_DEPTHS = 6
MAX_BALANCING = 6
#: What to do with the depth where a candidate does not hold: press less, press more.
LESS, MORE = 0.6, 1.5
#: No side takes more than this many times the mean depth, or less than the inverse.
MAX_SHARE = 10.0
#: What is out of balance by this many times what friction takes is not looked at more closely.
FAR = 4.0
#: Gaps are brought to their targets to this [m], in so many steps.
GAP_TOLERANCE = 1e-9
MAX_STEPS = 15


@dataclass(frozen=True, eq=False)
class Pressed:
    """
    A grip that holds the object.

    :ivar config: where the robot is.
    :ivar analyses: of it, one for each of `SPACINGS`.
    :ivar depths: how deep each side presses [m].
    """

    config: Configuration
    analyses: tuple[GraspAnalysis, ...]
    depths: Array


class Squeeze:
    """
    Searches the depths at which the sides of one grip hold the object.

    :ivar looked_at: configurations that were computed so far.
    :ivar analyses: analyses so far.
    :ivar nearest: what the best candidate so far misses.
    :param opened: where the sides are near the object.
    :param closing: what is to close.
    :param requirements: what the grasp is to fulfil.
    """

    def __init__(
        self, opened: Configuration, closing: Closing, requirements: GraspRequirements
    ) -> None:
        self._open, self._needs = opened, requirements
        # What a posture is drawn to would keep the gaps from their targets, by a little.
        self._closing = replace(closing, pull=None)
        self.looked_at = self.analyses = 0
        self.nearest: Miss | None = None

    def search(self) -> Pressed | None:
        """
        Return a grip that fulfils the requirements, or None; `nearest` says what was missed.

        :raises SolverError: a program, or the contact, was not solved.
        """
        diameter = self._open.robot.description.tube_diameter
        depth, low, high = FIRST_DEPTH * diameter, LEAST_DEPTH * diameter, MOST_DEPTH * diameter
        shares = np.ones(len(self._closing.sides))
        for _ in range(MAX_DEPTHS):
            found = self._balance(depth, shares)
            if isinstance(found, Pressed):
                return found
            # What is too deep here and not deep enough there has only the depths between left.
            low, high = (depth, high) if found > 1.0 else (low, depth)
            depth = float(
                np.clip(found * depth, low + 0.1 * (high - low), high - 0.1 * (high - low))
            )
            if high < 1.1 * low:
                break
        return None

    def way(self, pressed: Pressed) -> tuple[Configuration, ...]:
        """Return configurations from where all sides touch the object to where they hold it."""
        config, way = self._open, []
        for share in (0.0, 0.25, 0.5, 0.75):
            found = self.press(config, share * pressed.depths)
            if found is None:
                return ()
            config = found
            way.append(config)
        return (*way, pressed.config)

    def press(self, config: Configuration, depths: Array) -> Configuration | None:
        """Return the configuration in which each side presses that deep [m], or None."""
        place = look_at(config, self._closing.cylinder)
        sides, share = list(self._closing.sides), 1.0
        for _ in range(MAX_STEPS):
            left = float(np.abs(place.gaps.members[sides] + depths).max())
            if left <= GAP_TOLERANCE:
                return place.config
            made = step(place, self._closing, -depths, share)
            self.looked_at += made.looked_at
            if made.blocked:
                name, value = made.blocked
                self._note(Miss(name, value, self._closing.bound(name), 50.0))
                return None
            place, share = made.place, made.share
        self._note(Miss('reach', left, 0.0, 40.0 + left))
        return None

    def _balance(self, depth: float, shares: Array) -> Pressed | float:
        """
        Balance the sides at one mean depth.

        :param shares: of the mean depth, by side: where to begin.
        :return: the grip, or by what the depth is to be multiplied.
        """
        config, advice = self._open, LESS
        free = np.linalg.svd(np.ones((1, len(shares))))[2][1:].T  # what leaves the mean as it is
        slope: Array | None = None
        last: tuple[Array, Array] | None = None
        for _ in range(MAX_BALANCING):
            depths = depth * shares
            found = self.press(config, depths)
            if found is None:
                return LESS
            config = found
            analyses, missing = self._analyze_all(config, depths)
            advice = missing[1]
            if missing[0] is None:
                return Pressed(config, tuple(one for one, _ in analyses), depths)
            if any(load is None for _, load in analyses):
                return MORE
            loads = [load for _, load in analyses if load is not None]
            wanted, here = correction(loads), free.T @ depths
            if slope is None or last is None:
                slope = loads[0].slope @ free
            else:
                moved, change = here - last[0], loads[0].load - last[1]
                slope = slope + np.outer(change - slope @ moved, moved) / (moved @ moved)
            last = here, loads[0].load
            move = np.linalg.lstsq(slope, wanted, rcond=None)[0]
            size = float(np.abs(move).max())
            if size < 1e-3 * GAP_TOLERANCE:
                break
            shares = shares + free @ move * min(1.0, 0.5 * depth / size) / depth
            if shares.min() < 1.0 / MAX_SHARE or shares.max() > MAX_SHARE:
                return LESS
        return advice

    def _analyze_all(
        self, config: Configuration, depths: Array
    ) -> tuple[list[tuple[GraspAnalysis, Imbalance | None]], tuple[Miss | None, float]]:
        """
        Analyse a grip with each spacing, or until one shows that it is far from holding.

        :return: analyses with what they leave unbalanced; what is missed, as `_missing` says.
        """
        needs, closing = self._needs, self._closing
        found: list[tuple[GraspAnalysis, Imbalance | None]] = []
        worst: tuple[Miss | None, float] = (None, 1.0)
        for spacing in SPACINGS:
            self.analyses += 1
            analysis = analyze_grasp(
                config, closing.cylinder, needs.friction, needs.external_wrench, spacing=spacing
            )
            left = imbalance(
                config,
                closing.cylinder,
                analysis,
                needs.external_wrench,
                closing.sides,
                depths,
                needs.friction,
            )
            found.append((analysis, left))
            missing = self._missing(analysis)
            if missing[0] is not None:
                if worst[0] is None or missing[0].distance > worst[0].distance:
                    worst = missing
                if left is None or (np.abs(left.load) > FAR * left.width).any():
                    break
        if worst[0] is not None:
            self._note(worst[0])
        return found, worst

    def _missing(self, analysis: GraspAnalysis) -> tuple[Miss | None, float]:
        """Return what an analysed grip misses, and by what to multiply the depth then."""
        needs = self._needs
        total = float(analysis.normal_forces.sum())
        if total == 0.0:
            return Miss('force_closure', 0.0, 1.0, 30.0), MORE
        largest = max(analysis.contact_forces.values())
        for name, value in (('max_contact_force', largest), ('max_total_force', total)):
            bound = getattr(needs, name)
            if value > bound:
                return Miss(name, value, bound, 1.0 - bound / value), 0.95 * bound / value
        friction, margin = analysis.required_friction, analysis.closure_margin
        if not analysis.force_closure or margin < 0.0:
            # Where the plane of friction is all but flat, deeper contact is wider contact.
            advice = MORE if friction > 3.0 * needs.friction else LESS
            distance = 1.0 - margin / total
            return Miss('force_closure', friction, needs.friction, distance), advice
        if margin < needs.min_margin:
            short = 1.0 - margin / needs.min_margin
            return Miss('min_margin', margin, needs.min_margin, short), MORE
        return None, 1.0

    def _note(self, miss: Miss) -> None:
        if self.nearest is None or miss.distance < self.nearest.distance:
            self.nearest = miss
