"""
The first step of the search: bring the sides of a grip to where they nearly touch the object.

Kinematics only: from the present configuration, by admissible steps, so that they are the way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from isotruss_ros.core.closing import Closing, look_at
from isotruss_ros.core.closing_step import step
from isotruss_ros.core.configuration import Configuration
import numpy as np

#: The sides stop this far from the object, against the diameter of the tube, give or take.
STANDOFF, STANDOFF_TOLERANCE = 0.06, 0.02
MAX_STEPS = 100
#: Given up when more steps than this in a row have each brought what is left, in diameters of the
#: tube and in radians, less than `MIN_PROGRESS` below the least before.
PATIENCE, MIN_PROGRESS = 12, 0.1


@dataclass(frozen=True, eq=False)
class Approach:
    """
    An open grip around the object, and the way there.

    :ivar closing: what closes.
    :ivar path: the configurations on the way, the present one first; straight in roller travel
        between them.
    :ivar looked_at: configurations that were computed.
    :ivar missed: what is in the way: a requirement's name, and its value; None if nothing is.
    """

    closing: Closing
    path: tuple[Configuration, ...]
    looked_at: int
    missed: tuple[str, float] | None = None

    @property
    def travel(self) -> float:
        """Return the length of the way of the roller that goes furthest [m]."""
        places = np.array([config.roller_positions for config in self.path])
        return float(np.abs(np.diff(places, axis=0)).sum(axis=0).max(initial=0.0))


def approach(
    config: Configuration, closing: Closing, should_stop: Callable[[], bool] | None = None
) -> Approach:
    """
    Bring the sides near to the object and their opening down to what friction can hold.

    :param should_stop: asked before every step; an approach that was stopped has missed what was
        still in the way.
    :raises SolverError: a program was not solved.
    """
    diameter = config.robot.description.tube_diameter
    standoff, tolerance = STANDOFF * diameter, STANDOFF_TOLERANCE * diameter
    sides, targets = list(closing.sides), [standoff] * len(closing.sides)
    path, looked_at = [config], 0
    place = look_at(config, closing.cylinder)
    best, since, share = np.inf, 0, 1.0
    while True:
        gaps = place.gaps
        gap = float(gaps.members[sides].max()) - standoff
        wide = float(gaps.openings[closing.module]) - closing.opening
        if gap <= tolerance and wide <= 1e-3:
            return Approach(closing, tuple(path), looked_at)
        left = max(gap, 0.0) / diameter + max(wide, 0.0)
        since = 0 if left < best - MIN_PROGRESS else since + 1
        best = min(best, left) if since else left
        missed = ('opening', gaps.openings[closing.module]) if gap <= tolerance else ('reach', gap)
        given_up = since > PATIENCE or len(path) > MAX_STEPS
        if given_up or (should_stop is not None and should_stop()):
            return Approach(closing, tuple(path), looked_at, missed)
        made = step(place, closing, targets, share)
        looked_at += made.looked_at
        if made.blocked:
            return Approach(closing, tuple(path), looked_at, made.blocked)
        place, share = made.place, made.share
        path.append(place.config)
