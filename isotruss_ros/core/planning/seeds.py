# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Seeds of the search for grasps: pairs and triples of the members around an object."""

from __future__ import annotations

from dataclasses import replace
import itertools
import math

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.manipulation.grip import find_members, members_at
from isotruss_ros.core.manipulation.limits import MemberLengthLimit
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.planning.closing import BOUND_SHARE, Closing
from isotruss_ros.core.planning.facing import balances, CONE_SHARE, find_facing, TURNING_PRICE
from isotruss_ros.core.planning.requirements import GraspRequirements
from isotruss_ros.core.planning.violations import RequirementError
from isotruss_ros.core.safety.margins import object_distances
import numpy as np

#: Lines of sight from the object's middle.
SIGHTS = 180
#: Seeds of a round, the easiest first.
MAX_SEEDS = 8
#: Of random seeds: friction cones, as shares of the whole ones, and standard deviation of the
#: nominal roller positions, in mean lengths of members.
RANDOM_CONES, RANDOM_POSTURE = (0.5, 1.0), 0.3


def find_seeds(
    config: Configuration, body: ConvexObject, needs: GraspRequirements, seed: int, number: int
) -> list[Closing]:
    """
    Return the seeds of one round, pairs first, the easiest first.

    :param config: configuration of the robot.
    :param body: the object.
    :param needs: what a grasp must fulfil; of a required module only its two members grip, and of
        required members only these.
    :param seed: of the random numbers.
    :param number: of the round; the first is 0. In the others cones and postures are random,
        and few groups of members are tried several times.
    :raises RequirementError: why there are no seeds.
    :raises GraspError: the robot has no such module or members as those required.
    """
    around, file = enclosing_members(config, body.middle), config.robot.description
    wanted = required_members(config.robot, needs)
    groups = [group for count in (2, 3) for group in itertools.combinations(around, count)]
    groups = [group for group in groups if not wanted or wanted == set(group)]
    if number > 0 and groups:
        groups *= math.ceil(MAX_SEEDS / len(groups))
    limit = MemberLengthLimit(
        file.min_length if needs.min_length is None else needs.min_length,
        file.max_length if needs.max_length is None else needs.max_length,
        BOUND_SHARE,
    )
    gaps, length = object_distances(config, body), config.robot.home.member_lengths.mean()
    rng, radius = np.random.default_rng((seed, number)), 0.5 * file.tube_diameter
    found: list[tuple[float, Closing]] = []
    for group in groups:
        turning, cone, posture = TURNING_PRICE, math.atan(needs.friction), None
        if number > 0:
            turning *= rng.uniform(0.0, 1.0)
            away = length * rng.standard_normal(len(config.roller_positions))
            posture = config.roller_positions + RANDOM_POSTURE * away
            cone *= rng.uniform(*RANDOM_CONES)
        closing = Closing(body, group, (limit,), needs.min_rigidity, cone, posture)
        normals = closing.normals(config)
        if len(group) == 2:
            facing = find_facing(body, normals, CONE_SHARE * cone, radius, turning)
            closing = replace(closing, facing=facing)
        else:
            facing = normals if balances(body, normals, CONE_SHARE * cone, radius) else None
        if facing is not None:
            # How far members are from where they are to be.
            turns = float(np.abs(np.angle(facing / normals)).sum())
            found.append((float(gaps[list(group)].sum()) + 0.5 * length * turns, closing))
    if not found:
        seen = len(wanted.intersection(around))
        short = 'members' if seen < len(wanted) else 'opposed'
        why = (short, seen, len(wanted)) if around else ('enclosed', 0.0, 1.0)
        raise RequirementError(*why)
    # A tube that keeps its length seldom brings three members to an object at once.
    found.sort(key=lambda item: (len(item[1].members), item[0]))
    return [closing for _, closing in found[:MAX_SEEDS]]


def required_members(robot: Mechanism, needs: GraspRequirements) -> frozenset[int]:
    """
    Return the numbers of the members that are to grip; none where any may.

    :param robot: the robot.
    :param needs: what a grasp must fulfil.
    :raises GraspError: the robot has no such module or members.
    """
    names = needs.members or ()
    if needs.module is not None:
        names = members_at(robot, needs.module)
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
