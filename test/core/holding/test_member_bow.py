# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

from dataclasses import replace
import itertools

from carries import BRICK, FRICTION, GRASPS, LOOP, make_robot, MODULE, place
from comparison.grips import STILL
from held_grips import numbers
from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core import Disc, place_between
from isotruss_ros.core.holding.attach_grip import attach_grip, rest
from isotruss_ros.core.holding.loaded_frame import held_joints
from isotruss_ros.core.holding.member_bow import beam_bow, bend_members
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.statics.member_compliance import MemberCompliance
from isotruss_ros.mujoco_plant.plant import MujocoPlant
from mujoco_worlds import needs_mujoco
import numpy as np
import pytest
import scipy

ROBOT = make_robot()
TWO = members_at(ROBOT, MODULE)
SHARE = st.floats(0.05, 0.95)


def held(name):
    """Return how an object is held at home."""
    body, members = place(ROBOT, name, 0.5)
    return attach_grip(ROBOT.home, body, numbers(members))


def deflect(x, place, length):
    """Return deflection and slope of a beam on two supports under a unit load, EI = 1."""
    left = length - place
    if x > place:
        deflection, slope = deflect(length - x, left, length)
        return deflection, -slope
    deflection = left * x * (length**2 - left**2 - x**2) / (6.0 * length)
    return deflection, left * (length**2 - left**2 - 3.0 * x**2) / (6.0 * length)


@given(first=SHARE, second=SHARE, ratio=st.floats(-1.0, 1.0))
def test_a_beam_between_supports_is_shorter_by_the_quadrature_of_its_slope(first, second, ratio):
    length = 1.7
    places = length * np.unique([first, second + 1e-3])
    loads = np.array([1.0, ratio])[: len(places)]

    def line(x):
        bends = [deflect(x, place, length) for place in places]
        return loads @ np.array(bends)

    deflections, slopes = np.transpose([line(place) for place in places])
    ends = [0.0, *places, length]
    expected = sum(
        scipy.integrate.quad(lambda x: 0.5 * line(x)[1] ** 2, a, b)[0]
        for a, b in itertools.pairwise(ends)
    )
    assert beam_bow(length, places, deflections, slopes) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize('name', ['disc 0.2 m', 'box', 'three members'])
def test_members_are_shorter_by_what_the_frame_bends_them(name):
    grip = held(name)
    state, count = grip.state, len(grip.anchors)
    loads = np.zeros((count + 1, 3))
    loads[:count] = state.loads
    bow = bend_members(grip).shorter
    for member in grip.members:
        structure = grip.statics.compliance.structure
        line = MemberCompliance(structure, [*grip.contacts.members, member])
        places = np.linspace(0.0, line.length[-1], 401)
        across = [line.at(np.append(state.feet, x)).respond(loads)[-1, 1] for x in places]
        slopes = np.diff(across) / np.diff(places) - (across[-1] - across[0]) / places[-1]
        expected = 0.5 * slopes**2 @ np.diff(places)
        assert bow[member] == pytest.approx(expected, rel=0.05)
    assert np.count_nonzero(bow) == len(grip.members)


def bend(linear, members):
    """Return the grip at the same pose with members as they bend to second order."""
    grip, body = linear, linear.body
    for _ in range(3):
        bent = bend_members(grip)
        grip = attach_grip(ROBOT.home.shorten(bent.shorter), body, members)
        statics = replace(grip.statics, given=bent.given)
        closure = rest(statics, body)
        state = statics.solve(grip.state.unknowns, grip.wrench, closure)
        grip = replace(grip, statics=statics, state=state)
    return grip


@needs_mujoco
@pytest.mark.parametrize(
    ('shape', 'members', 'depth', 'linear'),
    [
        (Disc(0.25), TWO, 0.02, 0.91),
        (BRICK, GRASPS['brick'][1], 0.01, 0.98),
        (Disc(0.65), LOOP, 0.01, 0.985),
    ],
)
def test_joints_and_squeeze_are_those_of_mujoco(shape, members, depth, linear):
    body = place_between(ROBOT.home, members, shape, indentation=depth).body
    own = numbers(members)
    fine = np.full(len(ROBOT.member_names), 4)
    fine[own] = 32
    plant = MujocoPlant(ROBOT, [body], replace(STILL, friction=FRICTION), fine)
    plant.hold_object(body.pose)
    plant.settle(1.0)
    plant.release_object()
    plant.settle(2.0)
    body = body.moved_to(plant.object_pose())
    joints = plant.nodes[: len(ROBOT.topology.joint_names)]
    straight = attach_grip(ROBOT.home, body, own)
    bent = bend(straight, own)
    assert held_joints(bent) == pytest.approx(joints, abs=2e-4)
    measured = np.mean([force.normal for force in plant.contact_forces().values()])
    assert bent.squeeze == pytest.approx(measured, rel=0.015)
    # Linear statics has only half of what joints move by, and presses less.
    assert np.abs(held_joints(straight) - joints).max() > 3e-4
    assert straight.squeeze < linear * measured
