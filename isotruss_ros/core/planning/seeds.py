# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Seeds of the grasp search: closing motions of members from which the candidates start."""

from __future__ import annotations

from dataclasses import replace
import itertools
import math

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.manipulation.grip import find_members, members_at
from isotruss_ros.core.manipulation.limits import MemberLengthLimit
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.tolerances import ROUNDING
from isotruss_ros.core.planning.approach import BOUND_SHARE, Closing
from isotruss_ros.core.planning.facing import (
    balances,
    CONE_SHARE,
    find_facing,
    ROUNDED_DIGITS,
    TURN_WEIGHT,
)
from isotruss_ros.core.planning.requirements import GraspRequirements
from isotruss_ros.core.planning.violations import RequirementError
from isotruss_ros.core.safety.margins import object_distances
import numpy as np

#: Largest number of seeds of a round [-].
MAX_SEEDS = 8
#: Standard deviation of random nominal postures, in mean member lengths [-].
RANDOM_POSTURE = 0.3


def find_seeds(
    config: Configuration, body: ConvexObject, needs: GraspRequirements, seed: int, number: int
) -> list[Closing]:
    """Return the closing motions of a round of the search, pairs first, most promising first."""
    description, around = config.robot.description, enclosing_members(config, body.middle)
    required = required_members(config.robot, needs)
    groups = [*itertools.combinations(around, 2), *itertools.combinations(around, 3)]
    groups = [group for group in groups if not required or required == set(group)]
    if number > 0 and groups:
        groups *= math.ceil(MAX_SEEDS / len(groups))
    shortest = description.min_length if needs.min_length is None else needs.min_length
    longest = description.max_length if needs.max_length is None else needs.max_length
    limit = MemberLengthLimit(shortest, longest, BOUND_SHARE)
    gaps, length = object_distances(config, body), config.robot.home.member_lengths.mean()
    rng, radius = np.random.default_rng((seed, number)), 0.5 * description.tube_diameter
    seeds: list[tuple[float, Closing]] = []
    for group in groups:
        turn_weight, friction_angle, posture = TURN_WEIGHT, math.atan(needs.friction), None
        if number > 0:
            turn_weight *= rng.uniform(0.0, 1.0)
            random_travel = length * rng.standard_normal(len(config.roller_positions))
            posture = config.roller_positions + RANDOM_POSTURE * random_travel
            friction_angle *= rng.uniform(0.5, 1.0)
        closing = Closing(body, np.array(group), limit, needs, friction_angle, posture)
        normals, usable_angle = closing.normals(config), CONE_SHARE * friction_angle
        if len(group) == 2:
            facing = find_facing(body, normals, usable_angle, radius, turn_weight)
        else:
            facing = normals if balances(body, normals, usable_angle, radius) else None
        if facing is not None:
            rotation = np.abs(np.angle(facing / normals)).sum()
            cost = float(gaps[closing.members].sum() / length + 0.5 * rotation)
            seeds.append((round(cost, ROUNDED_DIGITS), replace(closing, facing=facing)))
    if not around:
        raise RequirementError('enclosed', 0.0, 1.0)
    if not seeds:
        visible, count = len(required.intersection(around)), len(required)
        raise RequirementError('members' if visible < count else 'opposed', visible, count)
    # Pairs first: three members of tubes with constant lengths rarely reach an object.
    seeds.sort(key=lambda item: (len(item[1].members), item[0]))
    return [closing for _, closing in seeds[:MAX_SEEDS]]


def required_members(robot: Mechanism, needs: GraspRequirements) -> frozenset[int]:
    """Return the indices of the required grasping members; empty if none are required."""
    names = needs.members or ()
    if needs.module is not None:
        names = members_at(robot, needs.module)
    return frozenset(find_members(robot.topology, names).members.tolist())


def enclosing_members(config: Configuration, point: complex) -> tuple[int, ...]:
    """Return the members visible from a point; none if the robot does not enclose the point."""
    topology, points = config.robot.topology, config.points
    count = topology.n_modules
    b, c = points[topology.b], points[topology.c]
    starts = np.concatenate([b, b, points[topology.joint]]) - point
    ends = np.concatenate([points[topology.end], c, 0.5 * (b + c)]) - point
    # Between the directions of ends, all lines of sight meet the same segments.
    angles = np.sort(np.angle(np.concatenate([starts, ends])))
    between = np.diff(angles, append=angles[0] + 2.0 * np.pi)
    sights = np.exp(1j * (angles + 0.5 * between)[between > ROUNDING, None])
    one, other = starts * sights.conj(), ends * sights.conj()
    crossing = (one.imag > 0.0) != (other.imag > 0.0)
    share = one.imag / np.where(crossing, one.imag - other.imag, 1.0)
    away = one.real + share * (other.real - one.real)
    away = np.where(crossing & (away > 0.0), away, np.inf)
    first = away.argmin(axis=1)
    if np.isinf(away.min(axis=1)).any():
        return ()
    return tuple(int(i) for i in np.unique(first[first < count]))
