"""
Closing the robot's sides on an object, step by step.

Every step is admissible, so the steps are a way there as well: where one leads is looked at, and
it is halved where it leads too near to trouble.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from isotruss_ros.core.closing import Closing, look_at, Place
from isotruss_ros.core.closing_program import CLEARANCE, solve_step
from isotruss_ros.core.errors import ConfigurationError
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: What is not to touch comes no nearer than this share of the clearance: programs know the first
#: order only.
KEPT = 0.5
#: A touching side may go beyond its target by this, against the diameter of the tube; twice the
#: sag between the ends of a step is less.
OVERSHOOT = 0.015
GAP_ROUNDING = 1e-12  # [m]
#: A step that leads too near to trouble is halved this often.
MAX_HALVINGS = 5


@dataclass(frozen=True, eq=False)
class Step:
    """
    One step.

    :ivar place: where it ends; where it began if there was no way.
    :ivar looked_at: configurations that were computed for it.
    :ivar share: of the longest step that the next one may well take.
    :ivar blocked: what would be missed beyond: a requirement's name and its value; None if the
        step was made.
    """

    place: Place
    looked_at: int
    share: float
    blocked: tuple[str, float] | None = None


def step(place: Place, closing: Closing, targets: Sequence[float], share: float = 1.0) -> Step:
    """
    Bring the gaps of the touching sides nearer to their targets.

    :param targets: one for each of `closing.sides` [m].
    :param share: of the longest step; `Step.share` of the step before is a good choice.
    :raises SolverError: the program was not solved.
    """
    aims = np.asarray(targets)
    move = solve_step(place, closing, aims, share)
    least = min(closing.min_rigidity, place.rigidity)
    room = min(0.0, place.clearance)
    floors = _floors(place, closing, aims)
    config = place.config
    blocked = ('reach', float((place.gaps.members[list(closing.sides)] - aims).max()))
    for halving in range(MAX_HALVINGS):
        try:
            moved = config.moved_to(config.roller_positions + 0.5**halving * move)
            there = look_at(moved, closing.cylinder)
        except ConfigurationError:
            blocked = ('rigidity', 0.0)
            continue
        distances = _distances(there)
        low = int((distances - floors).argmin())
        if there.rigidity < least:
            blocked = ('rigidity', there.rigidity)
        elif there.clearance < room:
            blocked = ('self_clearance', there.clearance)
        elif distances[low] < floors[low]:
            blocked = ('object_clearance', float(distances[low]))
        else:
            larger = 2.0 * share if halving == 0 else share * 0.5**halving
            return Step(there, halving + 1, min(1.0, larger))
    return Step(place, MAX_HALVINGS, share, blocked)


def _distances(place: Place) -> Array:
    return np.concatenate([place.gaps.members, place.gaps.modules])


def _floors(place: Place, closing: Closing, targets: Array) -> Array:
    """Return the gaps (2m,) that a step must leave."""
    diameter = place.config.robot.description.tube_diameter
    present = _distances(place)
    floors = np.full(len(present), KEPT * CLEARANCE * diameter)
    floors[list(closing.sides)] = targets - OVERSHOOT * diameter
    return np.minimum(floors, present - GAP_ROUNDING)
