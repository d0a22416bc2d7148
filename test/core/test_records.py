# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results are data: short to read, plain to write, equal by value."""

import copy
import enum
import inspect
import json
import math
import pickle
from typing import NamedTuple

from isotruss_ros import core
from isotruss_ros.core.numerics.records import as_plain, is_equal
import numpy as np
import pytest
import robots

ROBOT = core.load_robot('nine_member')
DISC = core.ConvexObject.disc(core.tangent_center(ROBOT.home, 'north/Z', 0.3, 0.01), 0.3, 0.8)
SETTLED = core.settle_grasp(ROBOT.home, DISC)
GRIP = core.Grip.at_module(ROBOT, 'north/Z', DISC)
MEMBERS = ('north/P-Z', 'north/Z-R')
LARGE = robots.random_robot(6)

RESULTS = {
    'robot': ROBOT,
    'object': DISC,
    'grip': GRIP,
    'configuration': ROBOT.configuration([0.01, 0.0, 0.0, 0.0, 0.0, 0.0]),
    'settled': SETTLED,
    'lost': core.settle_grasp(ROBOT.home, DISC.moved_to((0.7, 0.3, 0.0)), members=MEMBERS),
    'analysis': core.analyze_grasp(ROBOT.home, DISC),
    'chance': SETTLED.chance(core.Uncertainty()),
    'uncertainty': core.Uncertainty(offset_covariance=np.diag([1e-4] * 6)),
    'requirements': core.GraspRequirements(members=MEMBERS, carry=((0.7, 0.7, 0.0),)),
    'no chance': core.Uncertainty().chance(
        core.settle_grasp(ROBOT.home, DISC.moved_to((0.7, 0.3, 0.0)), members=MEMBERS)
    ),
    'gradient': core.grasp_gradient(SETTLED),
    'deformation': core.deform(ROBOT.home, {'Z': (0.0, -5.0)}),
    # Sparse factors.
    'large deformation': core.deform(LARGE.home, {LARGE.topology.joint_names[0]: (0.0, -1.0)}),
    'command': core.solve_twist(ROBOT.home, GRIP, (0.01, 0.02, 0.1)),
    'joint command': core.solve_joint_velocity(ROBOT.home, {'Z': (0.01, 0.0)}),
    'pose': core.reach_pose(ROBOT.home, GRIP, np.add(DISC.pose, (0.0, 0.01, 0.0))),
    'plan': core.plan_grasps(
        ROBOT.home,
        core.ConvexObject.disc((0.7, 0.3), 0.3),
        core.GraspRequirements(members=MEMBERS, min_slip_margin=0.0, count=1),
        max_rounds=1,
    ),
}


@pytest.fixture(params=RESULTS)
def result(request):
    return RESULTS[request.param]


def test_repr_has_six_short_lines_at_most(result):
    lines = repr(result).splitlines()
    assert lines[0] == type(result).__name__
    assert 2 <= len(lines) <= 6
    assert max(map(len, lines)) < 120


def test_first_line_of_a_settled_grasp_says_whether_it_is_held():
    assert repr(SETTLED).splitlines()[1] == '  hold: held'


def test_html_has_a_row_for_each_member(result):
    table = result._repr_html_()
    assert table.count('<table>') == table.count('</table>') > 0
    if result is SETTLED:
        for member in MEMBERS:
            assert f'<tr><th>{member}</th>' in table


def test_data_are_plain_python(result):
    data = result.to_dict()
    assert json.loads(json.dumps(data, allow_nan=False)) == data


def test_numbers_that_are_not_finite_are_none_in_data():
    analysis, requirements = RESULTS['analysis'], RESULTS['requirements']
    assert analysis.required_friction == requirements.max_total_force == math.inf
    assert analysis.to_dict()['required_friction'] is None
    assert requirements.to_dict()['max_total_force'] is None
    assert as_plain({1: [math.nan, -np.inf], 'a': np.array([np.inf, 1.0])}) == {
        '1': [None, None],
        'a': [None, 1.0],
    }


def test_chance_of_a_settled_grasp_has_the_signature_of_its_uncertainty():
    signature = inspect.signature(core.Uncertainty.chance).parameters
    settled = inspect.signature(type(SETTLED).chance)
    assert list(settled.parameters) == ['self', 'uncertainty', *list(signature)[2:]]
    assert settled.parameters['uncertainty'].annotation == 'Uncertainty'
    assert settled.return_annotation == 'Chance'
    for name in list(signature)[2:]:
        assert settled.parameters[name] == signature[name]


def test_data_have_forces_by_member():
    data = SETTLED.to_dict()
    assert set(data['normal_forces']) == set(MEMBERS)
    assert data['hold'] == 'held'
    assert data['pose']['x'] == pytest.approx(DISC.pose.x, abs=0.02)


def test_data_of_an_object_and_its_grip_have_their_fields():
    data = GRIP.to_dict()
    assert data['members'] == list(GRIP.members)
    assert data['body'] == DISC.to_dict()
    assert data['body'] | {'pose': None} == {
        'shape': {'diameter': 0.3},
        'pose': None,
        'mass': None,
        'center_of_mass': None,
        'friction': 0.8,
    }


@pytest.mark.parametrize(
    'copied', [copy.copy, copy.deepcopy, lambda result: pickle.loads(pickle.dumps(result))]
)
def test_copies_are_equal(result, copied):
    assert copied(result) == result


def test_other_results_are_not_equal(result):
    assert sum(result == other for other in RESULTS.values()) == 1
    assert RESULTS['configuration'] != ROBOT.home
    assert core.load_robot('triangle') != ROBOT


def test_equal_robots_and_shapes_have_one_hash():
    other = pickle.loads(pickle.dumps(ROBOT))
    assert hash(other) == hash(ROBOT)
    assert hash(other.home) == hash(ROBOT.home)
    assert len({other, ROBOT}) == 1


class Colour(enum.Enum):
    RED = 1


class Pair(NamedTuple):
    one: int
    other: complex


def test_values_of_all_kinds_are_plain():
    assert as_plain(np.array([1.0 + 2.0j])) == [[1.0, 2.0]]
    assert as_plain({'a': np.float64(2.0), 'b': (None, True)}) == {'a': 2.0, 'b': [None, True]}
    assert as_plain([Colour.RED, Pair(1, 1j), slice(0, 3)]) == [
        'RED',
        {'one': 1, 'other': [0.0, 1.0]},
        [0, 3],
    ]
    with pytest.raises(TypeError, match='object: must consist of numbers and texts'):
        as_plain(object())


def test_not_a_number_equals_itself():
    assert is_equal({'a': [np.nan]}, {'a': [np.nan]})
    assert is_equal(np.array([np.nan]), np.array([np.nan]))
    assert not is_equal([1.0], [1.0, 2.0])
    assert not is_equal(np.zeros(2), None)
