# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Every reader of messages: what it reads, and the messages that it rejects.

What nodes do then is in `test_bad_messages`.
"""

import math

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, PoseStamped, Quaternion, Twist, Vector3, WrenchStamped
from geometry_msgs.msg import Pose as PoseMessage
from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core import tangent_center
from isotruss_ros.core.numerics.arrays import MAX_LOAD
from isotruss_ros.nodes.conversions import messages, sensor_messages
from isotruss_ros.nodes.conversions.grasp_messages import read_external_wrench, to_wrench_message
from isotruss_ros.nodes.framework.robot_frame import RobotFrame
import numpy as np
from probe import DIAMETER, MODULE, N, ROBOT
import pytest
import robots
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Header

NAMES = list(ROBOT.roller_names)
FRAME = ROBOT.frame
CENTER = tangent_center(ROBOT.home, MODULE, DIAMETER)
BAD = (math.nan, math.inf, -math.inf)
HUGE = (1e308, -1e308, 1e100)
EXTREME, SMALL = (*BAD, *HUGE), (0.0, 0.5, 5e-324)
MANY = 10**5
numbers = st.floats(-1e3, 1e3)


def joint_states(**changes):
    return JointState(**({'name': NAMES, 'position': [0.0] * N} | changes))


def object_pose(frame=FRAME, **changes):
    pose = PoseMessage(position=Point(x=CENTER[0], y=CENTER[1]), orientation=Quaternion(w=1.0))
    for name, value in changes.items():
        setattr(pose, name, value)
    return PoseStamped(header=Header(frame_id=frame), pose=pose)


def wrench(frame=f'{FRAME}_object_aligned', **components):
    values = [components.get(name, 0.0) for name in ('fx', 'fy', 'm')]
    return WrenchStamped(header=Header(frame_id=frame), wrench=to_wrench_message(values))


def pressure(tube, value):
    return FluidPressure(header=Header(frame_id=tube), fluid_pressure=value)


def velocity(part, **components):
    """Return a twist with components of its linear or angular part."""
    return Twist(**{part: Vector3(**components)})


PRESSURE_RANGE = 'must be from 1000 to 300000'
REFUSED = {
    'joint states': (
        lambda message: sensor_messages.read_roller_part(message, NAMES),
        [
            *((joint_states(position=[v] + [0.0] * (N - 1)), 'finite, at most') for v in EXTREME),
            *((joint_states(velocity=[v] * N), 'must be at most') for v in (math.inf, *HUGE)),
            (joint_states(position=[]), '0 positions for 6 names'),
            (joint_states(velocity=[0.0] * (N - 1)), '5 velocities for 6 names'),
            (joint_states(position=[0.0] * MANY), f'{MANY} positions for 6 names'),
        ],
    ),
    'object pose': (
        RobotFrame(ROBOT).read_pose,
        [
            *((object_pose(position=Point(x=v)), 'must be finite, at most') for v in EXTREME),
            *((object_pose(position=Point(y=v)), 'must be finite, at most') for v in EXTREME),
            (object_pose(position=Point(x=750.0)), r'x must be .* if it is in mm, it is 0\.75 m'),
            *((object_pose(orientation=Quaternion(w=v)), 'norm') for v in (*EXTREME, *SMALL)),
            (object_pose(orientation=Quaternion(z=math.nan, w=1.0)), 'norm'),
            (object_pose(orientation=Quaternion(x=1.0, y=1.0, z=1.0, w=1.0)), 'norm 2'),
            (object_pose(frame='map'), "in frame 'map': must be 'truss'"),
        ],
    ),
    'joint markers': (
        lambda joints: sensor_messages.read_joint_markers(
            sensor_messages.to_joint_markers(joints), ROBOT
        ),
        [
            ({'W': (0.0, 0.0)}, "joint marker 'W': must be one of P, Q"),
            ({'P': (math.nan, 0.0)}, 'joint marker P at .nan, 0.0.: x must be finite'),
            ({'P': (0.0, -1e7)}, r'joint marker P at .*: y must be finite, at most 100 m'),
        ],
    ),
    'twist': (
        messages.read_twist,
        [
            *((velocity('linear', **{axis: v}), 'finite') for axis in 'xy' for v in BAD),
            *((velocity('angular', z=v), 'finite') for v in BAD),
            *((velocity('linear', z=v), 'planar') for v in (*EXTREME, 5e-324)),
            *((velocity('angular', **{axis: v}), 'planar') for axis in 'xy' for v in EXTREME),
        ],
    ),
    'external wrench': (
        lambda message: read_external_wrench(message, FRAME),
        [
            *(
                (wrench(**{name: v}), 'must be 3 finite numbers, at most 1e')
                for name in ('fx', 'fy', 'm')
                for v in (*EXTREME, 1.01 * MAX_LOAD, -1.01 * MAX_LOAD)
            ),
            (wrench(FRAME), "in frame 'truss': must be in 'truss_object_aligned'"),
            (wrench(f'{FRAME}_object'), "must be in 'truss_object_aligned'"),
        ],
    ),
    'tube pressure': (
        lambda message: sensor_messages.read_tube_pressure(message, ROBOT, 0.0),
        [
            (pressure('east', -1.0), rf'tube east \[Pa\]: -1.0: {PRESSURE_RANGE}'),
            (pressure('east', 34.5), rf'tube east \[Pa\]: 34.5: {PRESSURE_RANGE}'),
            (pressure('east', 1e7), rf'tube east \[Pa\]: 10000000.0: {PRESSURE_RANGE}'),
            (pressure('south', math.nan), 'tube south '),
            (pressure('north', math.inf), 'tube north '),
            (pressure('west', 3e4), "frame_id 'west': must be one of"),
        ],
    ),
}


@pytest.mark.parametrize('name', REFUSED)
def test_invalid_messages_are_rejected_with_the_faulty_field(name):
    read, cases = REFUSED[name]
    for message, words in cases:
        with pytest.raises(messages.MessageError, match=words) as error:
            read(message)
        assert len(str(error.value)) < 1000


@robots.examples(100)
@given(
    st.permutations(range(N)),
    st.lists(numbers, min_size=N, max_size=N),
    st.lists(st.floats(-10.0, 10.0), min_size=N, max_size=N),
)
def test_selects_the_rollers_in_any_order_among_other_joints(order, travel, speeds):
    message = JointState(
        name=['gripper', *(NAMES[i] for i in order)],
        position=[math.nan, *(travel[i] for i in order)],
        velocity=[math.inf, *(speeds[i] for i in order)],
    )
    result = sensor_messages.read_roller_part(message, NAMES)
    assert [result[i] for i in range(N)] == list(zip(travel, speeds, strict=True))


@pytest.mark.parametrize('velocity', [[], [math.nan] * N])
def test_velocities_that_are_not_measured_are_zero(velocity):
    result = sensor_messages.read_roller_part(joint_states(velocity=velocity), NAMES)
    assert result == dict.fromkeys(range(N), (0.0, 0.0))


@robots.examples(100)
@given(st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 3))
def test_twists_survive_a_round_trip(twist):
    assert messages.read_twist(messages.to_twist_message(twist)) == twist
    assert messages.read_twist(messages.to_twist_message(np.array(twist))) == twist


@robots.examples(100)
@given(st.integers(0, 2**31 - 1), st.integers(0, 10**9 - 1))
def test_stamps_survive_a_round_trip(sec, nanosec):
    when = messages.read_stamp(Header(stamp=Time(sec=sec, nanosec=nanosec)))
    assert messages.read_stamp(messages.make_header(when)) == pytest.approx(when, abs=3e-7)
    assert messages.read_stamp(messages.make_header(-when)) == 0.0


@pytest.mark.parametrize('frame', ['', f'{FRAME}_object_aligned'])
def test_planar_components_of_external_wrenches_are_read(frame):
    message = wrench(frame, fx=1.0, fy=-2.0, m=MAX_LOAD)
    message.wrench.force.z = message.wrench.torque.x = math.nan
    assert read_external_wrench(message, FRAME) == (1.0, -2.0, MAX_LOAD)


def test_a_wrench_in_the_frame_of_the_object_turns_with_it():
    message = wrench(f'{FRAME}_object', fx=1.0, fy=-2.0, m=3.0)
    result = read_external_wrench(message, FRAME, 0.5 * math.pi)
    assert result == pytest.approx((2.0, 1.0, 3.0))


def test_ambient_pressure_is_subtracted_from_absolute_pressures():
    result = sensor_messages.read_tube_pressure(pressure('east', 121_325.0), ROBOT, 101_325.0)
    assert result == ('east', pytest.approx(2e4))
