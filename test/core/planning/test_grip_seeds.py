# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What the search for grips of any members tries: members seen, turns, postures, the easiest."""

import math

import closings
from isotruss_ros.core import ConvexObject, Disc, GraspRequirements, load_robot
from isotruss_ros.core.planning import grip_seeds
from isotruss_ros.core.planning.closing_qp import outward_normals
from isotruss_ros.core.planning.grip_seeds import (
    enclosing_members,
    find_grip_seeds,
    NAMED_SEEDS,
    SIGHTS,
)
from isotruss_ros.core.planning.settings import SearchSettings
import numpy as np
import pytest

HOME = load_robot('nine_member').home
MANY = SearchSettings(max_grips=100)


def scene(seed):
    """Return a configuration and a disc within one of its loops."""
    config, cylinder, _ = closings.scene(seed)
    return config, ConvexObject(Disc(cylinder.diameter), (*cylinder.center, 0.0))


def seen_from(config, point):
    """Return the members that lines of sight meet first; none if one of them meets nothing."""
    begin, end, middle = closings.parts(config)
    joints = np.array([config.points[i] for i in config.robot.topology.joint])
    back = [config.points[nodes] for nodes in (config.robot.topology.b, config.robot.topology.c)]
    segments = [*zip(begin, end, strict=True), *zip(*back, strict=True)]
    segments += zip(joints, middle, strict=True)
    found = set()
    for angle in 2.0 * math.pi * (np.arange(SIGHTS) + 0.5) / SIGHTS:
        ray, hits = np.array([math.cos(angle), math.sin(angle)]), {}
        for number, (one, other) in enumerate(segments):
            start, span = one - point, other - one
            rows = np.column_stack([ray, [-span.real, -span.imag]])
            if abs(np.linalg.det(rows)) < 1e-12:
                continue
            away, share = np.linalg.solve(rows, [start.real, start.imag])
            if away > 0.0 and 0.0 <= share <= 1.0:
                hits[away] = number
        if not hits:
            return ()
        found.add(hits[min(hits)])
    return tuple(sorted(number for number in found if number < len(begin)))


@pytest.mark.parametrize('seed', range(6))
def test_members_that_are_seen_are_those_that_lines_of_sight_meet_first(seed):
    config, body = scene(seed)
    nodes, rng = config.points, np.random.default_rng(seed)
    near = nodes[rng.integers(len(nodes), size=3)]
    points = [body.middle, *(0.97 * near + 0.03 * body.middle), *(1.5 * near)]
    for point in points:
        assert enclosing_members(config, point) == seen_from(config, point)


def test_named_members_are_tried_once_and_then_more_often():
    needs = GraspRequirements(members=('north/P-Z', 'north/Z-R'))
    body = ConvexObject(Disc(0.2), (0.716, 0.5, 0.0))
    counts = [len(find_grip_seeds(HOME, body, needs, 0, number, MANY)) for number in range(3)]
    assert counts == [1, NAMED_SEEDS, NAMED_SEEDS]


def test_later_rounds_turn_members_farther(monkeypatch):
    body, prices = ConvexObject(Disc(0.2), (0.716, 0.5, 0.0)), []
    find_facing = grip_seeds.find_facing

    def record(body, normals, angle, turning):
        prices.append(turning)
        return find_facing(body, normals, angle, turning)

    monkeypatch.setattr(grip_seeds, 'find_facing', record)
    find_grip_seeds(HOME, body, GraspRequirements(), 0, 0, MANY)
    assert prices
    assert set(prices) == {0.3}
    prices.clear()
    for number in range(1, 80):
        find_grip_seeds(HOME, body, GraspRequirements(), 0, number, MANY)
    assert 0.0 < min(prices) < 0.01
    assert 0.29 < max(prices) < 0.3


@pytest.mark.parametrize('seed', [8, 18])
def test_later_rounds_draw_postures_in_lengths_of_the_members(seed):
    config, body = scene(seed)
    assert all(
        one.nominal_posture is None
        for one in find_grip_seeds(config, body, GraspRequirements(), 0, 0, MANY)
    )
    drawn = np.array(
        [
            one.nominal_posture - config.roller_positions
            for number in range(1, 40)
            for one in find_grip_seeds(config, body, GraspRequirements(), 0, number, MANY)
        ]
    )
    assert drawn.std() == pytest.approx(0.3 * config.member_lengths.mean(), rel=0.08)


@pytest.mark.parametrize('seed', [0, 8, 18])
def test_the_easiest_come_first(seed):
    config, body = scene(seed)
    found = find_grip_seeds(config, body, GraspRequirements(), 0, 0, MANY)
    radius = 0.5 * config.robot.description.tube_diameter
    reaches = closings.gaps(config, closings.scene(seed)[1])[0] + radius
    efforts = []
    for one in found:
        normals = outward_normals(config, one)
        facing = normals if one.facing is None else one.facing
        turns = np.abs(np.angle(facing / normals)).sum()
        reach = reaches[list(one.members)].sum()
        efforts.append(reach + 0.5 * config.member_lengths.mean() * turns)
    assert len(efforts) > 2
    assert efforts == sorted(efforts)
    few = SearchSettings(max_grips=1)
    (easiest,) = find_grip_seeds(config, body, GraspRequirements(), 0, 0, few)
    assert easiest.members == found[0].members
