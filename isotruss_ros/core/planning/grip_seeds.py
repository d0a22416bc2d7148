# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Seeds of the search for grips: pairs and triples of the members around an object."""

from __future__ import annotations

import itertools
import math

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import find_members, module_index
from isotruss_ros.core.manipulation.limits import Limit, MemberLengthLimit
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.segment_gaps import segment_gaps
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.planning.closing_qp import Closing, mean_member_length, outward_normals
from isotruss_ros.core.planning.facing import balances, find_facing
from isotruss_ros.core.planning.requirements import GraspRequirements
from isotruss_ros.core.planning.settings import DEFAULT, SearchSettings
import numpy as np

#: Lines of sight from the object's middle.
SIGHTS = 180
#: Random postures in a round for members that are named.
NAMED_SEEDS = 4


def find_grip_seeds(
    config: Configuration,
    body: ConvexObject,
    requirements: GraspRequirements,
    seed: int,
    number: int,
    settings: SearchSettings = DEFAULT,
) -> list[Closing]:
    """
    Return the seeds of one round, easiest first; none where members do not enclose the object.

    :param config: configuration of the robot.
    :param body: the object.
    :param requirements: what a grasp must fulfil; of a required module only its two members grip,
        and of required members only these.
    :param seed: of the random numbers.
    :param number: of the round; the first is 0. In the others directions and postures are random.
    :param settings: of the search.
    :raises GraspError: the robot has no such module or members as those required.
    """
    around = enclosing_members(config, body.middle)
    groups = [group for count in (2, 3) for group in itertools.combinations(around, count)]
    if requirements.module is not None:
        i = module_index(config.robot, requirements.module)
        pair = {i, int(config.robot.topology.previous[i])}
        groups = [group for group in groups if set(group) == pair]
    if requirements.members is not None:
        wanted = set(find_members(config.robot, requirements.members).members.tolist())
        groups = [group for group in groups if set(group) == wanted]
        if number > 0:
            groups *= NAMED_SEEDS
    cone = math.atan(requirements.friction)
    rng = np.random.default_rng((seed, number))
    found: list[tuple[float, Closing]] = []
    for group in groups:
        closing = _closing(config, body, group, cone, requirements, settings)
        normals = outward_normals(config, closing)
        turning = settings.turning_price
        if number > 0:
            turning *= float(rng.uniform(0.0, 1.0))
        turned = _facing(body, normals, settings.cone_share * cone, turning)
        if turned is None:
            continue
        posture = None
        if number > 0:
            size = settings.random_posture * mean_member_length(config)
            away = size * rng.standard_normal(len(config.roller_positions))
            posture = config.roller_positions + away
        facing = turned if len(group) == 2 else None
        seeded = _closing(config, body, group, cone, requirements, settings, posture, facing)
        found.append((_effort(config, body, group, normals, turned), seeded))
    found.sort(key=lambda item: item[0])
    return [closing for _, closing in found[: settings.max_grips]]


def _facing(body: ConvexObject, normals: Points, angle: float, turning: float) -> Points | None:
    """Return how members are to face the object; None where they cannot hold it."""
    if len(normals) == 2:
        return find_facing(body, normals, angle, turning)
    return normals if balances(body, normals, angle) else None


def _effort(
    config: Configuration,
    body: ConvexObject,
    members: tuple[int, ...],
    normals: Points,
    turned: Points,
) -> float:
    """Return how far members are from where they are to be, to compare groups by [m]."""
    topology, numbers = config.robot.topology, list(members)
    ends = topology.b[numbers], topology.c[topology.following[numbers]]
    gaps = segment_gaps(body, *(config.points[nodes] for nodes in ends)).gaps
    reach = 0.5 * mean_member_length(config)
    return float(gaps.sum() + reach * np.abs(np.angle(turned / normals)).sum())


def _closing(
    config: Configuration,
    body: ConvexObject,
    members: tuple[int, ...],
    cone: float,
    needs: GraspRequirements,
    settings: SearchSettings,
    posture: Array | None = None,
    facing: Points | None = None,
) -> Closing:
    """Return the seed with given members."""
    file = config.robot.description
    limits: tuple[Limit, ...] = (
        MemberLengthLimit(
            file.min_length if needs.min_length is None else needs.min_length,
            file.max_length if needs.max_length is None else needs.max_length,
            settings.bound_share,
        ),
    )
    return Closing(
        body, None, members, cone, limits, needs.min_rigidity, posture, settings, facing
    )


def count_seen(config: Configuration, point: complex, names: tuple[str, ...]) -> tuple[int, bool]:
    """
    Return how many of some members are seen from a point, and whether members enclose it.

    :param config: configuration of the robot.
    :param point: x + iy in the robot frame [m].
    :param names: of the members.
    :raises GraspError: the robot has no such members.
    """
    around = enclosing_members(config, point)
    return int(np.isin(find_members(config.robot, names).members, around).sum()), bool(around)


def enclosing_members(config: Configuration, point: complex) -> tuple[int, ...]:
    """
    Return the members that are seen from a point; none if one can see out between them.

    :param config: configuration of the robot.
    :param point: x + iy in the robot frame [m].
    """
    topology, points = config.robot.topology, config.points
    count = topology.n_modules
    b, c = points[topology.b], points[topology.c]
    starts = np.concatenate([b, b, points[topology.joint]]) - point
    ends = np.concatenate([points[topology.c[topology.following]], c, 0.5 * (b + c)]) - point
    sights = np.exp(2j * np.pi * (np.arange(SIGHTS)[:, None] + 0.5) / SIGHTS)
    # Where lines of sight meet the segments.
    one, other = starts * sights.conj(), ends * sights.conj()
    crossing = (one.imag > 0.0) != (other.imag > 0.0)
    share = one.imag / np.where(crossing, one.imag - other.imag, 1.0)
    away = one.real + share * (other.real - one.real)
    away = np.where(crossing & (away > 0.0), away, np.inf)
    first = away.argmin(axis=1)
    if np.isinf(away.min(axis=1)).any():
        return ()
    return tuple(int(i) for i in np.unique(first[first < count]))
