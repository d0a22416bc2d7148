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
    description, enclosing = config.robot.description, enclosing_members(config, body.middle)
    required = required_members(config.robot, needs)
    if not enclosing:
        raise RequirementError('enclosed', 0.0, 1.0)
    groups = [*itertools.combinations(enclosing, 2), *itertools.combinations(enclosing, 3)]
    groups = [group for group in groups if not required or required == set(group)]
    if number > 0 and groups:  # each group starts from several random postures
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

        # Directions of the members with force closure; three members must have them already.
        closing = Closing(body, np.array(group), limit, needs, friction_angle, posture)
        normals, usable_angle = closing.normals(config), CONE_SHARE * friction_angle
        if len(group) == 2:
            facing = find_facing(body, normals, usable_angle, radius, turn_weight)
        else:
            facing = normals if balances(body, normals, usable_angle, radius) else None
        if facing is None:
            continue
        rotation = np.abs(np.angle(facing / normals)).sum()
        cost = float(gaps[closing.members].sum() / length + 0.5 * rotation)
        seeds.append((round(cost, ROUNDED_DIGITS), replace(closing, facing=facing)))
    if not seeds:
        visible, count = len(required.intersection(enclosing)), len(required)
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
    b, c = points[topology.b], points[topology.c]
    # Segments that block the view: members, modules from B to C, and rods from joints to modules.
    starts = np.concatenate([b, b, points[topology.joint]]) - point
    ends = np.concatenate([points[topology.end], c, 0.5 * (b + c)]) - point
    # Lines of sight midway between the directions of successive ends: from there to the next end,
    # all lines of sight meet the same segments.
    angles = np.sort(np.angle(np.concatenate([starts, ends])))
    between = np.diff(angles, append=angles[0] + 2.0 * np.pi)
    sights = np.exp(1j * (angles + 0.5 * between)[between > ROUNDING, None])
    # Ends of the segments along (real) and across each line of sight; axes: line, segment.
    local_starts, local_ends = starts * sights.conj(), ends * sights.conj()
    crosses = (local_starts.imag > 0.0) != (local_ends.imag > 0.0)
    # Distances along the lines of sight to the points where segments cross them.
    share = local_starts.imag / np.where(crosses, local_starts.imag - local_ends.imag, 1.0)
    distances = local_starts.real + share * (local_ends.real - local_starts.real)
    distances = np.where(crosses & (distances > 0.0), distances, np.inf)
    if np.isinf(distances.min(axis=1)).any():
        return ()
    nearest = distances.argmin(axis=1)  # the first segments are the members
    return tuple(int(i) for i in np.unique(nearest[nearest < topology.n_modules]))
