# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results are data: short to read, plain to write, equal by value."""

import copy
import json
import math
import pickle

from isotruss_ros import core
import numpy as np
import pytest

ROBOT = core.load_robot('nine_member')
DISC = core.ConvexObject.disc(core.tangent_center(ROBOT.home, 'north/Z', 0.3, 0.01), 0.3, 0.8)
SETTLED = core.settle_grasp(ROBOT.home, DISC)
GRIP = core.Grip.at_module(ROBOT, 'north/Z', DISC)
MEMBERS = ('north/P-Z', 'north/Z-R')
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
    'command': core.solve_twist(ROBOT.home, GRIP, (0.01, 0.02, 0.1)),
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


def test_results_are_short_in_text_and_tables_and_data_are_plain_python(result):
    lines = repr(result).splitlines()
    assert lines[0] == type(result).__name__
    assert max(map(len, lines)) < 120
    table = result._repr_html_()
    assert table.count('<table>') == table.count('</table>') > 0
    assert result is not SETTLED or all(f'<tr><th>{name}</th>' in table for name in MEMBERS)
    data = result.to_dict()
    assert json.loads(json.dumps(data, allow_nan=False)) == data


def test_numbers_that_are_not_finite_are_none_in_data():
    analysis, requirements = RESULTS['analysis'], RESULTS['requirements']
    assert analysis.required_friction == requirements.max_total_force == math.inf
    assert analysis.to_dict()['required_friction'] is None
    assert requirements.to_dict()['max_total_force'] is None


def test_data_have_forces_by_member():
    data = SETTLED.to_dict()
    assert set(data['normal_forces']) == set(MEMBERS)
    assert data['hold'] == 'held'
    assert data['pose']['x'] == pytest.approx(DISC.pose.x, abs=0.02)


@pytest.mark.parametrize(
    'copied', [copy.copy, copy.deepcopy, lambda result: pickle.loads(pickle.dumps(result))]
)
def test_copies_are_equal(result, copied):
    assert copied(result) == result


def test_other_results_are_not_equal(result):
    assert sum(result == other for other in RESULTS.values()) == 1
    assert RESULTS['configuration'] != ROBOT.home
    assert core.load_robot('triangle') != ROBOT
    assert hash(pickle.loads(pickle.dumps(ROBOT)).home) == hash(ROBOT.home)
