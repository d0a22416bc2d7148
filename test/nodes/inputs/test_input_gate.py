# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the nodes make of stamps, of joint states in parts, and of frames that move."""

import contextlib

from geometry_msgs.msg import TransformStamped
from isotruss_msgs.msg import GraspState, StateEstimate
from isotruss_ros.core import Status
from isotruss_ros.core.inputs import CLOCK_SKEW
from isotruss_ros.nodes.bring_up.preflight import Preflight
from isotruss_ros.nodes.conversions.messages import make_header, read_stamp
from isotruss_ros.nodes.framework import robot_frame
from isotruss_ros.nodes.grasp_analysis import GraspAnalysisNode
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.state_estimator import StateEstimatorNode
from manual_world import moving_world, world
from nightly import some_now
import numpy as np
import probe
from probe import maker, manipulation, N, ROBOT
import pytest
from rclpy.clock import Clock
from sensor_msgs.msg import FluidPressure

NAMES = list(ROBOT.roller_names)
MOVING = (Status.OK, Status.ACCELERATING)
GRIPPER = {'name': ['gripper'], 'position': [0.0]}
estimator = maker(StateEstimatorNode)


def codes(w, begin=Status.OK):
    reported = [message.code for _, message in w.probe.seen['status']]
    return set(reported[reported.index(begin) :])  # noqa: E203


@contextlib.contextmanager
def estimating():
    with world(estimator()) as w:
        w.probe.listen(StateEstimate, 'estimate', 'state_estimate')
        w.spin(0.3, w.probe.send_joints)
        yield w


def others(w):
    w.probe.send_pose()
    w.probe.send_twist()


def send_gauges(w, tubes):
    w.probe.send_measured()
    for tube in tubes:
        header = make_header(w.probe.past(0.0), tube)
        w.probe.gauges.publish(FluidPressure(header=header, fluid_pressure=3e4))


@pytest.mark.parametrize('parts', [(NAMES, ['gripper']), (NAMES[:3], NAMES[3:])])
def test_joint_states_of_two_broadcasters_are_one_input(parts):
    with world(manipulation()) as w:

        def send():
            others(w)
            for names in parts:
                w.probe.send_joints(name=names, position=[0.0] * len(names))

        w.until_code(Status.OK, send)
        w.spin(0.4, send)
        assert codes(w) == {Status.OK}


def test_all_messages_of_a_burst_are_merged():
    with probe.world(manipulation()) as w:

        def send():
            others(w)
            for name in NAMES:
                w.probe.send_joints(name=[name], position=[0.0])

        w.spin(0.5, send)
        assert w.probe.last('status').code in MOVING, w.probe.last('status').message


def test_a_broadcaster_that_falls_silent_stops_the_rollers_and_its_rollers_are_named():
    half = {'name': NAMES[:3], 'position': [0.0] * 3}
    with moving_world() as w:
        status = w.until_code(
            Status.HALT_STALE_JOINT_STATES, lambda: (others(w), w.probe.send_joints(**half))
        )
        assert f'roller {NAMES[3]} was read 0.' in status.message


UNUSABLE = {
    'old joint states': lambda w: w.probe.send_joints(age=1.0),
    'very old joint states': lambda w: w.probe.send_joints(age=3600.0),
    'pose in another frame': lambda w: w.probe.send_pose(frame='elsewhere'),
    **{
        f'gripper of age {age}': lambda w, age=age: w.probe.send_joints(age, **GRIPPER)
        for age in (-0.02, 3600.0, -3600.0)
    },
}


@pytest.mark.parametrize('name', UNUSABLE)
def test_unusable_messages_among_valid_ones_do_not_stop_the_rollers(name):
    with moving_world() as w:
        w.spin(0.4, lambda: (w.probe.send_all(), UNUSABLE[name](w)))
        assert codes(w) <= {*MOVING}


@pytest.mark.parametrize('by', [-3600.0, -3.0])
def test_pressures_from_before_a_clock_jump_are_not_used(by):
    tubes = tuple(ROBOT.description.pressures)
    with world(lambda: GraspAnalysisNode()) as w:
        w.spin(0.2, lambda: send_gauges(w, tubes))
        assert w.code('state') == GraspState.OK
        w.shift = by
        # Neither the pressures of the robot file nor the earlier ones of other tubes are used.
        for new_tubes in ((), tubes[:1]):
            w.spin(0.5, lambda new=new_tubes: send_gauges(w, new))
            assert w.code('state') == GraspState.INVALID_TUBE_PRESSURES
        w.spin(0.2, lambda: send_gauges(w, tubes))
        assert w.code('state') == GraspState.OK


def test_a_joint_state_with_a_future_stamp_ages_from_its_reception():
    with moving_world() as w:
        w.probe.send_joints(age=-0.99 * CLOCK_SKEW)
        w.deliver()
        sent = w.now
        w.until_code(Status.HALT_STALE_JOINT_STATES, lambda: others(w))
        assert w.now - sent < 0.2 + 0.02


@pytest.mark.parametrize('ahead', [0.05, 2.0, 3600.0])
def test_a_stamp_from_the_future_costs_one_cycle(ahead):
    with moving_world() as w:
        w.probe.send_joints(age=-ahead)
        w.until_code(Status.HALT_INVALID_JOINT_STATES, lambda: None)
        sent = w.now
        w.until(lambda: w.code() in MOVING, w.probe.send_all)
        assert w.now - sent < 0.03


@pytest.mark.parametrize('age', [-2.0, -3600.0, 3600.0])
def test_an_estimate_goes_on_after_joint_states_of_another_time(age):
    with estimating() as w:
        w.probe.send_joints(age=age, position=[0.5] * N)
        w.spin(0.1, w.probe.send_joints)
        last = w.probe.last('estimate')
        assert np.abs(last.travel).max() < 1e-6
        assert w.probe.past(0.0) - read_stamp(last.header) < 0.05


def test_encoders_whose_clock_was_set_back_end_the_estimate_with_the_reason():
    with estimating() as w:
        w.spin(0.5, lambda: w.probe.send_joints(age=3600.0))
        w.probe.seen['estimate'].clear()
        w.spin(1.0, lambda: w.probe.send_joints(age=3600.0))
        assert not w.probe.seen['estimate']
        assert 'joint states: 3600.0' in w.report('state_estimator').message


@pytest.mark.parametrize('age', [-2.0, 3600.0])
def test_a_rejected_pose_is_a_warning_of_the_estimator(age):
    with estimating() as w:
        w.spin(1.5, lambda: w.probe.send_measured(age=age))
        assert 'object pose: ' in w.report('state_estimator').message


@pytest.mark.parametrize('age', [100.0, -2.0])
@pytest.mark.parametrize('make', [GraspAnalysisNode, Manipulation])
def test_an_estimate_of_another_time_is_not_added_to_the_encoders(make, age):
    with world(make) as w:
        estimates = w.probe.create_publisher(StateEstimate, 'state_estimate', 1)
        message = StateEstimate(roller_names=NAMES, offsets=[0.02] * N)
        message.offset_covariance = (1e-6 * np.eye(N)).ravel().tolist()
        for late, added in ((age, False), (0.0, True)):
            message.header = make_header(w.probe.past(late), 'truss')
            estimates.publish(message)
            w.spin(0.1, lambda: w.probe.send_joints(position=[0.01] * N))
            rollers = w.nodes[1].inputs.rollers.value
            assert rollers.offsets == pytest.approx([0.02 * added] * N)
            assert rollers.positions == pytest.approx([0.01 + 0.02 * added] * N)


@pytest.mark.parametrize(('ahead', 'right'), [(0.002, True), (0.02, False)])
def test_preflight_and_manipulation_allow_the_same_skew(ahead, right, capsys):
    with world(lambda: Preflight()) as w, pytest.raises(Exception, match='faults'):
        w.spin(5.0, lambda: w.probe.send_joints(age=-ahead))
    printed = capsys.readouterr().out
    assert ('ok    encoders' in printed) is right
    assert ('FAULT encoders: joint states: stamped 0.02' in printed) is not right


class Transforms:
    """Transforms that come so long after their stamps, at 30 Hz; a fake, as tf2 has no wheels."""

    def __init__(self, late):
        self._late = late

    def lookup_transform(self, _target, _source, time):
        period = 1.0 / 30.0
        newest = (1e-9 * Clock().now().nanoseconds - self._late) // period * period
        if 1e-9 * time.nanoseconds > newest:
            raise robot_frame.NO_TRANSFORM[0]('extrapolation into the future')
        return TransformStamped()


def send_in_camera(w):
    """Publish all inputs, the pose of the object in the frame of a camera."""
    w.probe.send_joints()
    w.probe.send_twist((0.0, 0.0, 0.0))
    w.probe.send_pose(frame='camera')


@pytest.fixture
def hear_transforms(monkeypatch):
    """Return a function that lets nodes hear transforms that are late [s]."""

    def install(late):
        # There are no wheels of tf2.
        monkeypatch.setattr(robot_frame, 'Buffer', lambda: Transforms(late))
        monkeypatch.setattr(robot_frame, 'TransformListener', lambda *m: m, raising=False)
        monkeypatch.setattr(robot_frame, 'NO_TRANSFORM', (LookupError, ValueError))

    return install


@pytest.mark.parametrize('late', some_now([0.1, 0.005, 0.03]))
def test_a_pose_waits_for_its_transform(late, hear_transforms):
    hear_transforms(late)
    with world(manipulation()) as w:
        w.until_code(Status.IDLE, lambda: send_in_camera(w))
        w.spin(0.4, lambda: send_in_camera(w))
        assert codes(w, Status.IDLE) == {Status.IDLE}


def test_a_pose_waits_no_longer_than_the_timeout(hear_transforms):
    hear_transforms(5.0)
    with world(manipulation()) as w:
        status = w.until_code(Status.HALT_INVALID_OBJECT_POSE, lambda: send_in_camera(w))
        assert 'extrapolation into the future' in status.message
