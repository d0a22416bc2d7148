# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What a grasp is worth by its forces and places alone."""

import itertools
from types import SimpleNamespace

from isotruss_ros.core import HoldStatus
from isotruss_ros.core.grasping.slip_margin import slip_margin, weakest_direction, WrenchResponse
from isotruss_ros.core.grasping.sticking_grasp import scaled_wrench, StickingGrasp
import numpy as np
import pytest


@pytest.mark.parametrize(
    ('normal', 'feet', 'hold'),
    [
        ([0.05, 1.0], [0.0, 0.8], HoldStatus.HELD),
        ([0.0, 1.0], [0.3, 0.3], HoldStatus.NO_CONTACT),
        ([1.0, -0.05], [0.3, 0.3], HoldStatus.NO_CONTACT),
        ([1.0, 1.0], [-0.01, 0.3], HoldStatus.OFF_MEMBER),
        ([1.0, 1.0], [0.3, 0.81], HoldStatus.OFF_MEMBER),
        ([1.0, 0.1], [0.3, 0.3], HoldStatus.SLIPS),
    ],
)
def test_a_grasp_holds_where_all_members_press_on_their_length_and_stick(normal, feet, hold):
    grasp = StickingGrasp()
    grasp.state = SimpleNamespace(
        normal_forces=np.array(normal),
        friction_forces=np.array([0.01, -0.06]),
        feet=np.array(feet),
    )
    lengths = SimpleNamespace(length=np.array([0.7, 0.8]))
    grasp.statics = SimpleNamespace(owners=np.arange(2), compliance=lengths)
    assert grasp.hold(0.5) is hold


@pytest.mark.parametrize('arm', [0.2, 1.0])
@pytest.mark.parametrize(('one', 'other'), itertools.permutations(range(3), 2))
@pytest.mark.parametrize('share', [0.98, 1.02])
def test_an_equilibrium_is_stable_where_every_displacement_takes_work(one, other, share, arm):
    # Displacements by wrenches, angles times the arm: of two kinds the mean of what each does to
    # the other may not be more than what both do to themselves.
    even = np.eye(3)
    even[one, other], even[other, one] = 2.0 * share + 0.25, -0.25
    pose = even / [[1.0], [1.0], [arm]]
    response = WrenchResponse(pose, np.zeros((2, 3)), np.zeros((2, 3)), np.arange(2), arm)
    assert response.stable == (share < 1.0)
    # Wrenches (fx, fy, m / arm).
    wrench = response.stiffness @ pose / [[1.0], [1.0], [arm]]
    assert wrench == pytest.approx(np.eye(3))


def test_a_member_slips_by_the_sums_over_its_contacts():
    # One end of the face rubs by more than its own normal force bears; the other one helps.
    state = SimpleNamespace(
        normal_forces=np.array([1.0, 3.0, 4.0]), friction_forces=np.array([0.9, 0.3, 0.2])
    )
    by_normal = np.tile([0.0, 0.0, 0.1], (3, 1))
    by_friction = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    response = WrenchResponse(np.eye(3), by_normal, by_friction, np.array([0, 0, 1]), 0.2)
    # mu N - T of the first member is 0.5 * 4 - 1.2, and falls by 2 fx - 0.5 * 0.2 m / arm.
    size = np.hypot(2.0, 0.1)
    assert slip_margin(state, response, 0.5) == pytest.approx(0.8 / size)
    direction = np.array([2.0, 0.0, -0.1]) / size
    assert weakest_direction(state, response, 0.5) == pytest.approx(direction)
    # The other way round as well.
    other_way = SimpleNamespace(
        normal_forces=state.normal_forces, friction_forces=-state.friction_forces
    )
    assert slip_margin(other_way, response, 0.5) == pytest.approx(0.8 / size)
    assert weakest_direction(other_way, response, 0.5)[0] == pytest.approx(-direction[0])
    assert response.squeeze == pytest.approx([0.0, 0.0, 0.15])
    # Far from slipping, the first contact lets go.
    assert slip_margin(state, response, 50.0) == pytest.approx(1.0 / 0.1)


def test_forces_of_members_are_sums_over_their_contacts():
    grasp = StickingGrasp()
    grasp.state = SimpleNamespace(
        normal_forces=np.array([1.0, 3.0, 5.0]), friction_forces=np.array([0.4, 0.8, -2.0])
    )
    grasp.statics = SimpleNamespace(owners=np.array([0, 0, 1]))
    assert grasp.normal_forces == pytest.approx([4.0, 5.0])
    assert grasp.friction_forces == pytest.approx([1.2, -2.0])
    assert grasp.squeeze == pytest.approx(4.5)
    assert grasp.required_friction == pytest.approx(0.4)


@pytest.mark.parametrize(('angle', 'within'), [(3.0, 3.0), (4.0, 4.0 - 2.0 * np.pi)])
def test_the_angle_of_a_pose_is_within_half_a_turn(angle, within):
    grasp = StickingGrasp()
    grasp.state = SimpleNamespace(unknowns=np.array([1.0, 2.0, angle, 0.5]))
    assert grasp.pose == pytest.approx((1.0, 2.0, within))


def test_moments_compare_with_forces_by_the_arm():
    assert scaled_wrench([3.0, 4.0, 0.5], 0.2) == pytest.approx([3.0, 4.0, 2.5])
    assert scaled_wrench(None, 0.2).tolist() == [0.0, 0.0, 0.0]
