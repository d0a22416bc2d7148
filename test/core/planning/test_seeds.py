# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Candidates of the grasp search: members, directions and postures."""

import math

from isotruss_ros.core import ConvexObject, GraspRequirements
from isotruss_ros.core.planning.facing import friction_angles
from isotruss_ros.core.planning.seeds import find_seeds
import numpy as np
import pytest
from robots import preset

HOME = preset('nine_member').home
NAMES = HOME.robot.member_names
BODY = ConvexObject.disc((0.716, 0.5), 0.2)
ANY = GraspRequirements()
RADIUS = 0.5 * HOME.robot.description.tube_diameter


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


@pytest.mark.parametrize('number', [0, 1])
def test_pairs_face_the_object_within_three_quarters_of_the_friction_angle(number):
    for seed in find_seeds(HOME, BODY, ANY, 0, number):
        assert seed.friction_angle <= math.atan(ANY.friction)
        if len(seed.members) == 2:
            used = friction_angles(BODY, seed.facing[:1], seed.facing[1:], RADIUS)[0]
            assert used <= 0.75 * seed.friction_angle + 1e-12


def test_random_postures_differ_by_round_and_seed():
    drawn = [
        one.nominal_posture
        for seed in range(6)
        for number in range(1, 5)
        for one in find_seeds(HOME, BODY, ANY, seed, number)
    ]
    assert len(np.unique(np.array(drawn).round(12), axis=0)) == len(drawn)
    again = find_seeds(HOME, BODY, ANY, 0, 1)
    assert all((a.nominal_posture == b).all() for a, b in zip(again, drawn, strict=False))
