# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Seeds of the search for grasps: pairs and triples of the members around an object."""

from __future__ import annotations

from dataclasses import replace
import itertools
import math

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.grip import find_members, members_at
from isotruss_ros.core.manipulation.limits import MemberLengthLimit
from isotruss_ros.core.model.convex_object import ConvexObject, segment_gaps
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.planning.closing import Closing, mean_member_length, outward_normals
from isotruss_ros.core.planning.facing import balances, find_facing
from isotruss_ros.core.planning.requirements import GraspRequirements
from isotruss_ros.core.planning.settings import DEFAULT, SearchSettings
import numpy as np

#: Lines of sight from the object's middle.
SIGHTS = 180


def find_seeds(
    config: Configuration,
    body: ConvexObject,
    requirements: GraspRequirements,
    seed: int,
    number: int,
    settings: SearchSettings = DEFAULT,
) -> list[Closing]:
    """
    Return the seeds of one round, pairs first, the easiest first.

    There are none where members do not enclose the object.

    :param config: configuration of the robot.
    :param body: the object.
    :param requirements: what a grasp must fulfil; of a required module only its two members grip,
        and of required members only these.
    :param seed: of the random numbers.
    :param number: of the round; the first is 0. In the others cones and postures are random,
        and few groups of members are tried several times.
    :param settings: of the search.
    :raises GraspError: the robot has no such module or members as those required.
    """
    rng = np.random.default_rng((seed, number))
    found: list[tuple[float, Closing]] = []
    for closing in _drafts(config, body, requirements, number, settings):
        turning = settings.turning_price
        if number > 0:
            turning *= float(rng.uniform(0.0, 1.0))
            size = settings.random_posture * mean_member_length(config)
            away = size * rng.standard_normal(len(config.roller_positions))
            closing = replace(
                closing,
                nominal_posture=config.roller_positions + away,
                friction_angle=closing.friction_angle * rng.uniform(*settings.random_cones),
            )
        normals = outward_normals(config, closing)
        facing = _facing(closing, normals, turning)
        if facing is None:
            continue
        effort = _effort(config, closing, np.angle(facing / normals))
        if len(normals) == 2:
            closing = replace(closing, facing=facing)
        found.append((effort, closing))
    # A tube that keeps its length seldom brings three members to an object at once.
    found.sort(key=lambda item: (len(item[1].members), item[0]))
    return [closing for _, closing in found[: settings.max_grips]]


def explain_no_seeds(
    config: Configuration, body: ConvexObject, requirements: GraspRequirements
) -> tuple[str, float, float, float]:
    """
    Return why there is not even a seed, as `SearchTally.record` takes it.

    No members go around the object, or not those required.

    :param config: configuration of the robot.
    :param body: the object.
    :param requirements: what a grasp must fulfil.
    :raises GraspError: the robot has no such module or members as those required.
    """
    around = enclosing_members(config, body.middle)
    if not around:
        return 'enclosed', 0.0, 1.0, 1000.0
    wanted = required_members(config.robot, requirements)
    seen = len(wanted.intersection(around))
    name = 'members' if seen < len(wanted) else 'opposed'
    return name, float(seen), float(len(wanted)), 1000.0


def required_members(robot: Robot, requirements: GraspRequirements) -> frozenset[int]:
    """
    Return the numbers of the members that are to grip; none where any may.

    :param robot: the robot.
    :param requirements: what a grasp must fulfil.
    :raises GraspError: the robot has no such module or members.
    """
    names = requirements.members or ()
    if requirements.module is not None:
        names = members_at(robot, requirements.module)
    return frozenset(find_members(robot, names).members.tolist())


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


def _drafts(
    config: Configuration,
    body: ConvexObject,
    needs: GraspRequirements,
    number: int,
    settings: SearchSettings,
) -> list[Closing]:
    """Return what may close, of each group of members; in later rounds about `max_grips`."""
    around, file = enclosing_members(config, body.middle), config.robot.description
    groups = [group for count in (2, 3) for group in itertools.combinations(around, count)]
    wanted = required_members(config.robot, needs)
    if wanted:
        groups = [group for group in groups if wanted == set(group)]
    if number > 0 and groups:
        groups *= math.ceil(settings.max_grips / len(groups))
    limit = MemberLengthLimit(
        file.min_length if needs.min_length is None else needs.min_length,
        file.max_length if needs.max_length is None else needs.max_length,
        settings.bound_share,
    )
    cone = math.atan(needs.friction)
    return [
        Closing(body, group, (limit,), needs.min_rigidity, cone, settings=settings)
        for group in groups
    ]


def _facing(closing: Closing, normals: Points, turning: float) -> Points | None:
    """Return how members are to face the object; None where they cannot hold it."""
    angle = closing.settings.cone_share * closing.friction_angle
    if len(normals) == 2:
        return find_facing(closing.body, normals, angle, turning)
    return normals if balances(closing.body, normals, angle) else None


def _effort(config: Configuration, closing: Closing, turns: Array) -> float:
    """Return how far members are from where they are to be, to compare groups by [m]."""
    topology, numbers = config.robot.topology, list(closing.members)
    ends = topology.b[numbers], topology.c[topology.following[numbers]]
    gaps = segment_gaps(closing.body, *(config.points[nodes] for nodes in ends)).gaps
    reach = 0.5 * mean_member_length(config)
    return float(gaps.sum() + reach * np.abs(turns).sum())
