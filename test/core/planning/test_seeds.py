# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the search for grasps tries: members seen, turns, cones, postures, the easiest first."""

import math

import closings
from isotruss_ros.core import ConvexObject, GraspRequirements
from isotruss_ros.core.planning.facing import friction_angles
from isotruss_ros.core.planning.seeds import enclosing_members, find_seeds
import numpy as np
import pytest
from robots import preset

HOME = preset('nine_member').home
NAMES = HOME.robot.member_names
BODY = ConvexObject.disc((0.716, 0.5), 0.2)
ANY = GraspRequirements()
RADIUS = 0.5 * HOME.robot.description.tube_diameter


def seen_from(config, point):
    """Return the members that many lines of sight meet first; none if one meets nothing."""
    begin, end, middle = closings.parts(config)
    joints = np.array([config.points[i] for i in config.robot.topology.joint])
    back = [config.points[nodes] for nodes in (config.robot.topology.b, config.robot.topology.c)]
    starts = np.concatenate([begin, back[0], joints]) - point
    spans = np.concatenate([end, back[1], middle]) - point - starts
    rays = np.exp(2j * math.pi * (np.arange(1000)[:, None] + 0.5) / 1000)
    # start + share * span = away * ray, solved by Cramer's rule.
    with np.errstate(divide='ignore', invalid='ignore'):
        share = (rays * starts.conj()).imag / (rays.conj() * spans).imag
        away = (starts.conj() * spans).imag / (rays.conj() * spans).imag
    away = np.where((away > 0.0) & (share >= 0.0) & (share <= 1.0), away, np.inf)
    if not np.isfinite(away.min(axis=1)).all():
        return ()
    return tuple(i for i in np.unique(away.argmin(axis=1)) if i < len(begin))


@pytest.mark.parametrize('seed', range(6))
def test_members_that_are_seen_are_those_that_lines_of_sight_meet_first(seed):
    config, body, _ = closings.scene(seed)
    nodes, rng = config.points, np.random.default_rng(seed)
    near = nodes[rng.integers(len(nodes), size=3)]
    points = [body.middle, *(0.97 * near + 0.03 * body.middle), *(1.5 * near)]
    for point in points:
        assert enclosing_members(config, point) == seen_from(config, point)


def test_pairs_and_triples_of_the_members_around_are_tried():
    found = find_seeds(HOME, BODY, ANY, 0, 0)
    assert sorted(len(seed.members) for seed in found) == [2, 2, 2, 3]
    assert {NAMES[i] for seed in found for i in seed.members} == {
        'north/P-Z',
        'north/Z-R',
        'north/R-P',
    }


@pytest.mark.parametrize('number', [0, 1])
@pytest.mark.parametrize(
    'wanted', [{'module': 'north/Z'}, {'members': ('north/P-Z', 'north/Z-R')}]
)
def test_only_the_members_that_are_asked_for_are_tried(wanted, number):
    found = find_seeds(HOME, BODY, GraspRequirements(**wanted), 0, number)
    assert len(found) == (8 if number else 1)
    for seed in found:
        assert {NAMES[i] for i in seed.members} == {'north/P-Z', 'north/Z-R'}


@pytest.mark.parametrize('seed', range(6))
def test_pairs_face_the_object_so_that_friction_holds_to_spare(seed):
    config, body, _ = closings.scene(seed)
    for number in (0, 1):
        for one in find_seeds(config, body, ANY, 0, number):
            assert one.friction_angle <= math.atan(ANY.friction)
            if len(one.members) == 2:
                used = friction_angles(body, one.facing[:1], one.facing[1:], RADIUS)[0]
                assert used <= 0.75 * one.friction_angle + 1e-12


def test_what_is_drawn_is_another_in_every_round_and_with_every_seed():
    drawn = [
        one.nominal_posture
        for seed in range(6)
        for number in range(1, 5)
        for one in find_seeds(HOME, BODY, ANY, seed, number)
    ]
    assert len(np.unique(np.array(drawn).round(12), axis=0)) == len(drawn)
    again = find_seeds(HOME, BODY, ANY, 0, 1)
    assert all((a.nominal_posture == b).all() for a, b in zip(again, drawn, strict=False))


@pytest.mark.parametrize(
    ('values', 'lengths'),
    [({}, (0.25, 2.0)), ({'min_length': 0.5}, (0.5, 2.0)), ({'max_length': 1.5}, (0.25, 1.5))],
)
def test_bounds_are_those_required_or_of_the_robot_file(values, lengths):
    needs = GraspRequirements(min_rigidity=0.31, **values)
    for number in (0, 1):
        for one in find_seeds(HOME, BODY, needs, 0, number):
            assert (one.body, one.needs.min_rigidity) == (BODY, 0.31)
            rows = one.limit.rows(HOME)
            # Half of what is left in one step, so that it is never crossed.
            half = 0.5 * (np.array(lengths)[:, None] - HOME.member_lengths)
            assert rows.lower == pytest.approx(half[0])
            assert rows.upper == pytest.approx(half[1])
