# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Seeds of the search for grasps: which members close, how far, toward which posture."""

from __future__ import annotations

import math
from typing import NamedTuple

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import module_index
from isotruss_ros.core.manipulation.limits import Limit, MemberLengthLimit

Cylinder = type(None)
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.planning.closing_qp import Closing, mean_member_length
from isotruss_ros.core.planning.requirements import GraspRequirements
from isotruss_ros.core.planning.settings import DEFAULT, SearchSettings
from isotruss_ros.core.safety.distances import object_gaps
import numpy as np


def find_seeds(
    config: Configuration,
    cylinder: Cylinder,
    requirements: GraspRequirements,
    seed: int,
    number: int,
    settings: SearchSettings = DEFAULT,
) -> list[Closing]:
    """
    Return the seeds of one round, in their order; none where no loop encloses the object.

    :param config: configuration of the robot.
    :param cylinder: the object.
    :param requirements: what a grasp must fulfil.
    :param seed: of the random numbers.
    :param number: of the round; the first is 0.
    :param settings: of the search.
    :raises GraspError: the robot has no such module as the one required.
    """
    topology = config.robot.topology
    required = requirements.module
    number_required = None if required is None else module_index(config.robot, required)
    center = complex(*cylinder.center)
    around = [t for t in range(len(topology.tube_names)) if encloses(config, t, center)]
    modules = [
        int(i)
        for i in np.flatnonzero(np.isin(topology.tube, around))
        if number_required is None or i == number_required
    ]
    if not modules:
        return []
    # Friction just holds a wedge of this opening.
    holding = 2.0 * math.atan(requirements.friction)
    draft = _Draft(config, cylinder, requirements, settings)
    if number > 0:
        return _random(draft, modules, holding, (seed, number))
    pairs = [
        draft.closing((i, int(topology.previous[i])), share * holding)
        for i in modules
        for share in settings.openings
    ]
    if requirements.squeeze is not None or requirements.min_slip_margin > 0.0:
        return pairs  # both are of two members on a free object
    return [*pairs, *_enclosing(draft, modules)]


class _Draft(NamedTuple):
    """What all seeds have in common."""

    config: Configuration
    cylinder: Cylinder
    requirements: GraspRequirements
    settings: SearchSettings

    def closing(
        self,
        members: tuple[int, ...],
        opening: float,
        nominal_posture: Array | None = None,
    ) -> Closing:
        """Return the seed with given grasping members, opening [rad] and posture (r,) [m]."""
        file, needs = self.config.robot.description, self.requirements
        limits: tuple[Limit, ...] = (
            MemberLengthLimit(
                file.min_length if needs.min_length is None else needs.min_length,
                file.max_length if needs.max_length is None else needs.max_length,
                self.settings.bound_share,
            ),
        )
        return Closing(
            self.cylinder,
            members[0],
            members,
            float(np.clip(opening, *self.settings.opening_range)),
            limits,
            needs.min_rigidity,
            nominal_posture,
            self.settings,
        )


def _enclosing(draft: _Draft, modules: list[int]) -> list[Closing]:
    """Return seeds with a third grasping member: the closest other one of each tube."""
    topology = draft.config.robot.topology
    gaps = object_gaps(draft.config, draft.cylinder).members
    found: list[Closing] = []
    for tube in sorted({int(topology.tube[i]) for i in modules}):
        first = next(i for i in modules if topology.tube[i] == tube)
        two = (first, int(topology.previous[first]))
        others = [int(i) for i in np.flatnonzero(topology.tube == tube) if i not in two]
        third = min(others, key=lambda i: gaps[i])
        found.append(draft.closing((*two, third), draft.settings.opening_range[1]))
    return found


def _random(
    draft: _Draft, modules: list[int], holding: float, entropy: tuple[int, int]
) -> list[Closing]:
    """Return seeds with random modules, openings and nominal postures."""
    rng = np.random.default_rng(entropy)
    settings, config = draft.settings, draft.config
    found = []
    for _ in range(settings.random_seeds):
        i = int(rng.choice(modules))
        opening = rng.uniform(*settings.random_openings) * holding
        size = settings.random_posture * mean_member_length(config)
        away = size * rng.standard_normal(len(config.roller_positions))
        members = (i, int(config.robot.topology.previous[i]))
        found.append(draft.closing(members, opening, config.roller_positions + away))
    return found


def encloses(config: Configuration, tube: int, point: complex) -> bool:
    """
    Return whether a point is inside the loop that a tube makes.

    :param config: configuration of the robot.
    :param tube: the number of the tube.
    :param point: x + iy in the robot frame [m].
    """
    topology = config.robot.topology
    modules = np.flatnonzero(topology.tube == tube)
    corners = np.stack(
        [config.points[topology.c[modules]], config.points[topology.b[modules]]], axis=1
    )
    around = corners.ravel() - point
    # Seen from inside the loop is a whole turn, from outside none.
    return bool(abs(np.angle(np.roll(around, -1) / around).sum()) > np.pi)
