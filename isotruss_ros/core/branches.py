"""The branches of the search for grasps: which sides close, how far, toward which posture."""

from __future__ import annotations

import math

from isotruss_ros.core.closing import Closing, scale
from isotruss_ros.core.closing_program import APPROACH
from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.grasp import module_index
from isotruss_ros.core.grasp_analysis import Cylinder
from isotruss_ros.core.limits import Limit, MemberLengthLimit
from isotruss_ros.core.object_gaps import encloses, object_gaps
from isotruss_ros.core.requirements import GraspRequirements
import numpy as np

#: A wedge of an opening of 2 atan(friction) just holds; grips are narrower by these shares.
OPENINGS = (0.8, 0.56)
#: Those drawn at random are between these shares.
RANDOM_OPENINGS = (0.4, 0.9)
#: Postures drawn at random are about that far from where the robot is, against the mean length
#: of members at home.
RANDOM_POSTURE = 0.3
RANDOM_BRANCHES, MAX_ROUNDS = 8, 5
#: The narrowest and the widest grip [rad].
NARROWEST, WIDEST = 0.1, 2.8


def branches(
    config: Configuration,
    cylinder: Cylinder,
    requirements: GraspRequirements,
    seed: int,
    number: int,
) -> list[Closing]:
    """
    Return the branches of one round, in their order; none where no loop encloses the object.

    :param number: of the round; the first is 0.
    :raises GraspError: the robot has no such module as the one required.
    """
    layout = config.robot.layout
    required = requirements.module
    wanted = None if required is None else module_index(config.robot, required)
    center = complex(*cylinder.center)
    around = [t for t in range(len(layout.tube_names)) if encloses(config, t, center)]
    modules = [
        int(i)
        for i in np.flatnonzero(np.isin(layout.tube, around))
        if wanted is None or i == wanted
    ]
    if not modules:
        return []
    holding = 2.0 * math.atan(requirements.friction)
    if number > 0:
        return _random(config, cylinder, requirements, modules, holding, (seed, number))
    pairs = [
        _closing(config, cylinder, requirements, (i, int(layout.previous[i])), share * holding)
        for i in modules
        for share in OPENINGS
    ]
    return [*pairs, *_enclosing(config, cylinder, requirements, modules)]


def _enclosing(
    config: Configuration,
    cylinder: Cylinder,
    requirements: GraspRequirements,
    modules: list[int],
) -> list[Closing]:
    """Return branches in which a third side touches too: of each tube, that which is nearest."""
    layout = config.robot.layout
    gaps = object_gaps(config, cylinder).members
    found: list[Closing] = []
    for tube in sorted({int(layout.tube[i]) for i in modules}):
        first = next(i for i in modules if layout.tube[i] == tube)
        two = (first, int(layout.previous[first]))
        others = [int(i) for i in np.flatnonzero(layout.tube == tube) if i not in two]
        third = min(others, key=lambda i: gaps[i])
        found.append(_closing(config, cylinder, requirements, (*two, third), WIDEST))
    return found


def _random(
    config: Configuration,
    cylinder: Cylinder,
    requirements: GraspRequirements,
    modules: list[int],
    holding: float,
    entropy: tuple[int, int],
) -> list[Closing]:
    draw = np.random.default_rng(entropy)
    layout, found = config.robot.layout, []
    for _ in range(RANDOM_BRANCHES):
        i = int(draw.choice(modules))
        opening = draw.uniform(*RANDOM_OPENINGS) * holding
        away = RANDOM_POSTURE * scale(config) * draw.standard_normal(len(config.roller_positions))
        pull = config.roller_positions + away
        sides = (i, int(layout.previous[i]))
        found.append(_closing(config, cylinder, requirements, sides, opening, pull))
    return found


def _closing(
    config: Configuration,
    cylinder: Cylinder,
    requirements: GraspRequirements,
    sides: tuple[int, ...],
    opening: float,
    pull: np.ndarray | None = None,
) -> Closing:
    file = config.robot.description
    shortest, longest = requirements.min_length, requirements.max_length
    limits: tuple[Limit, ...] = (
        MemberLengthLimit(
            file.min_length if shortest is None else shortest,
            file.max_length if longest is None else longest,
            APPROACH,
        ),
    )
    opening = float(np.clip(opening, NARROWEST, WIDEST))
    return Closing(cylinder, sides[0], sides, opening, limits, requirements.min_rigidity, pull)
