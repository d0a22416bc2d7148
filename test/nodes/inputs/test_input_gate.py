# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stamps, joint states in parts, messages that replace others, and frames that move."""

import contextlib
from types import SimpleNamespace

from geometry_msgs.msg import TransformStamped, TwistStamped
from hypothesis import given
from hypothesis import strategies as st
from isotruss_msgs.msg import GraspState, StateEstimate
from isotruss_ros.core import inputs, Status
from isotruss_ros.core.inputs import CLOCK_SKEW
from isotruss_ros.nodes.bring_up.preflight import Preflight
from isotruss_ros.nodes.conversions.messages import make_header, read_stamp
from isotruss_ros.nodes.framework import robot_frame
from isotruss_ros.nodes.framework.gate import Gate, Topic
from isotruss_ros.nodes.framework.received_inputs import keep_latest, RollerParts
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
import robots
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

        w.until_code(Status.OK, send)


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
        w.spin(0.3, lambda: (w.probe.send_all(), UNUSABLE[name](w)))
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


NOW, TIMEOUT = 100.0, 0.2
NEW, LATE = inputs.StampedInput('new', NOW), inputs.StampedInput('late', NOW - 0.1)
BAD = inputs.RejectedInput('bad')
ROLLERS = ('a', 'b', 'c')
moments = st.floats(0.0, 1.0)


def test_an_earlier_input_does_not_replace_a_later_one():
    assert keep_latest(NEW, LATE, NOW) is NEW
    assert keep_latest(LATE, NEW, NOW) is NEW


@pytest.mark.parametrize(
    ('kept', 'new', 'now'),
    [(None, LATE, NOW), (BAD, LATE, NOW), (None, BAD, NOW), (NEW, LATE, NOW - 0.1)],
    ids=['none', 'rejected', 'none by a rejection', 'before the clock was set back'],
)
def test_an_input_replaces_one_that_is_none_rejected_or_from_the_future(kept, new, now):
    assert keep_latest(kept, new, now) is new


def test_a_rejection_is_the_reason_after_the_timeout_of_the_valid_input():
    kept = keep_latest(NEW, BAD, NOW)
    with pytest.raises(inputs.InputError, match='bad') as caught:
        inputs.require_fresh(NOW + 1.01 * TIMEOUT, TIMEOUT, object_pose=kept)
    assert (caught.value.name, caught.value.fault) == ('object_pose', inputs.InputFault.INVALID)


def part(rollers, time, speed):
    """Return readings of rollers that turn evenly, each by its own speed."""
    return {number: (speed[number] * time, speed[number]) for number in rollers}


@robots.examples(100)
@given(
    st.lists(st.tuples(st.sets(st.integers(0, 2), min_size=1), moments), max_size=20),
    st.tuples(*3 * [st.floats(-0.1, 0.1)]),
)
def test_parts_in_any_order_make_the_state_of_one_time(messages, speed):
    parts, last = RollerParts(ROLLERS), dict.fromkeys(range(3), 0.0)
    for rollers, time in [({0, 1, 2}, 0.0), *messages]:
        parts.take(part(rollers, time, speed), time, 2.0)
        last |= {number: max(last[number], time) for number in rollers}
        result = parts.merged()
        assert result.time == min(last.values())
        assert result.value.positions == pytest.approx(np.multiply(speed, result.time), abs=1e-9)
        assert result.value.offsets == 0.0


def test_rollers_that_were_never_read_are_named():
    parts = RollerParts(ROLLERS)
    parts.take(part((1,), 1.0, (0.1, 0.1, 0.1)), 1.0, 2.0)
    assert 'rollers a, c are missing' in parts.merged().reason


def test_a_reading_at_the_current_time_keeps_the_earlier_ones_of_its_roller():
    parts = RollerParts(ROLLERS)
    for rollers, time in (((0, 1, 2), 1.0), ((1,), 1.5), ((0, 2), 2.0), ((0, 2), 2.0)):
        parts.take(part(rollers, time, (0.1, 0.1, 0.1)), time, time)
    merged = parts.merged()
    assert merged.time == 1.5
    assert merged.value.positions == pytest.approx(np.full(3, 0.15))


class Receiver:
    """Gate of a node without a middleware, whose clock the test sets."""

    def __init__(self, simulated=False):
        self.now, self.passed = NOW, []
        node = SimpleNamespace(
            values=SimpleNamespace(command_timeout=0.2),
            now=lambda: self.now,
            get_parameter=lambda _: SimpleNamespace(value=simulated),
            create_subscription=lambda *_, **__: None,
        )
        topic = Topic(TwistStamped, 'cmd_vel', lambda _: 'twist')
        self.gate = Gate(node, topic, lambda result, _: self.passed.append(result), None, False)

    def receive(self, now, stamp):
        """Return the input that results from a message with a stamp [s]."""
        self.now = now
        # An older message of the same burst is not used.
        stamps = stamp - 0.01, stamp
        headers = [make_header(time, 'truss') for time in stamps]
        self.gate.receive([(TwistStamped(header=header), None) for header in headers])
        (received,) = self.passed
        self.passed.clear()
        return received


@pytest.mark.parametrize(('simulated', 'skew'), [(False, 0.01), (True, 0.1)])
def test_stamp_may_be_ahead_of_real_time_by_10_ms_and_of_simulated_time_by_100_ms(simulated, skew):
    receive = Receiver(simulated).receive
    assert receive(NOW, NOW + 0.9 * skew).time == NOW
    rejected = receive(NOW, NOW + 1.1 * skew)
    assert rejected.reason.startswith('cmd vel: stamped 0.')


def test_repeated_stamp_from_ahead_keeps_the_time_of_its_first_reception():
    receive = Receiver().receive
    assert receive(NOW, NOW + 0.008).time == NOW
    assert receive(NOW + 0.004, NOW + 0.008).time == NOW
    assert receive(NOW + 0.012, NOW + 0.008).time == NOW
    assert receive(NOW + 0.02, NOW + 0.015).time == pytest.approx(NOW + 0.015, abs=1e-6)
