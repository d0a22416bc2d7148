# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Unusable messages and parameters on every input of every node.

The node keeps running, the rollers are at rest while an input is unusable, no command is faster
than the rollers' limit, and good inputs move the object again.
"""

from functools import partial
import itertools
import math
from types import SimpleNamespace

from geometry_msgs.msg import Point, TwistStamped
from grips import disc_grip
from hypothesis import given
from hypothesis import strategies as st
from isotruss_msgs.srv import AnalyzeGrasp
from isotruss_ros.core import Pose, Status, TwistServo
from isotruss_ros.core.inputs import RejectedInput, StampedInput
from isotruss_ros.core.servo.servo_settings import ServoSettings
from isotruss_ros.nodes.conversions.messages import make_header, MessageError, to_twist_message
from isotruss_ros.nodes.conversions.sensor_messages import read_roller_part
from isotruss_ros.nodes.framework.received_inputs import RollerParts
from isotruss_ros.nodes.grasp.grasp_report import GraspCode
from isotruss_ros.nodes.grasp_analysis import GraspAnalysisNode
from isotruss_ros.nodes.grasp_planner import GraspPlanner
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.path_follower import PathFollower
from isotruss_ros.nodes.simulator.node import Simulator
from manual_world import world
import numpy as np
from probe import CENTER, manipulation, MODULE, N, overrides, ROBOT
import pytest
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
import robots
from sensor_msgs.msg import JointState

NAMES = list(ROBOT.roller_names)
MAX_SPEED = ROBOT.description.max_speed
BAD = (math.nan, math.inf, -math.inf)
HUGE = (1e308, -1e308, 1e100)
FOREVER = 10**5
values = st.one_of(st.floats(-0.3, 0.3), st.floats(), st.sampled_from((*BAD, *HUGE, 5e-324)))
rows = st.lists(values, max_size=N + 2)


def check_command(command, status):
    assert command.shape == (N,)
    assert np.isfinite(command).all()
    assert np.abs(command).max() <= MAX_SPEED + 1e-9
    if status >= Status.HALT_NO_TWIST:
        assert not command.any()


def check(w):
    """Check all commands since the last check, each with the status of its cycle."""
    commands, statuses = w.probe.seen['command'], w.probe.seen['status']
    assert len(commands) == len(statuses) > 0
    for (_, command), (_, status) in zip(commands, statuses, strict=True):
        check_command(np.array(command.data), status.code)
    commands.clear()
    statuses.clear()


#: Changes of each input, the fault that they are (`_` is the input), and words of the message; the
#: tables of all that readers reject are in test_object_messages.py.
TIMES = {
    'long ago': ({'age': 1e3}, 'STALE_', 'old'),
    'in the future': ({'age': -1e3}, 'INVALID_', 'future'),
    'after all time': ({'stamp': 2**31 - 1}, 'INVALID_', 'future'),
    'without a stamp': ({'stamp': 0}, 'STALE_', 'the stamp is missing'),
}
JOINT_STATES = TIMES | {
    'rejected': ({'position': [math.nan] * N}, 'INVALID_', 'finite'),
    'out of reach': ({'position': [1e3] * N}, 'KINEMATICS', 'long'),
    'too long': ({'position': [9.0] + [0.0] * (N - 1)}, 'KINEMATICS', 'long'),
}
POSES = TIMES | {
    'rejected': ({'center': (math.nan, 0.0)}, 'INVALID_', 'finite'),
    'of another frame': ({'frame': 'map'}, 'INVALID_', "must be 'truss'"),
}
APART = {'far away': ({'center': (100.0, 100.0)}, 'NO_GRASP', 'does not touch')}
TWISTS = {'rejected': ({'twist': (math.nan, 0.0, 0.0)}, 'INVALID_', 'finite')}
WRENCHES = TIMES | {
    'rejected': ({'wrench': (math.inf, 0.0, 0.0)}, 'INVALID_', 'finite'),
    'of another frame': ({'frame': 'map'}, 'INVALID_', "must be in 'truss_object_aligned'"),
}
MANIPULATION = (manipulation(), Status, 'status')
ANALYSIS = (GraspAnalysisNode, GraspCode, 'state')
#: For the analysis it is no error that an object touches nothing.
INPUTS = [
    (MANIPULATION, 'joint_states', JOINT_STATES),
    (MANIPULATION, 'object_pose', POSES | APART),
    (MANIPULATION, 'cmd_vel', TWISTS),
    (ANALYSIS, 'joint_states', JOINT_STATES),
    (ANALYSIS, 'object_pose', POSES),
    (ANALYSIS, 'external_wrench', WRENCHES),
]


def code_of(codes, fault, topic):
    words = {'cmd_vel': 'TWIST', 'external_wrench': 'EXTERNAL_WRENCH'}.get(topic, topic.upper())
    name = fault + words if fault.endswith('_') else fault
    if codes is GraspCode:
        return codes[name.replace('KINEMATICS', 'NO_CONFIGURATION')]
    return codes[f'HALT_{name}']


def send_input(w, topic, stamp=None, **changes):
    send = {
        'joint_states': w.probe.send_joints,
        'object_pose': w.probe.send_pose,
        'cmd_vel': w.probe.send_twist,
        'external_wrench': partial(w.probe.send_wrench, wrench=(0.0, 0.0, 0.0)),
    }[topic]
    if stamp is not None:
        changes['age'] = w.probe.past(stamp)
    send(**changes)


@pytest.mark.parametrize(
    ('node', 'topic', 'cases'), INPUTS, ids=[f'{node[2]}-{topic}' for node, topic, _ in INPUTS]
)
def test_every_invalid_input_is_named_until_there_are_valid_ones(node, topic, cases):
    make, codes, key = node
    topics = {'joint_states', 'object_pose', 'cmd_vel', 'external_wrench'}

    def send(case=None):
        for name in topics - {topic} if case is not None else topics:
            send_input(w, name)
        if case is not None:
            send_input(w, topic, **case)

    with world(make) as w:
        for case, fault, words in cases.values():
            w.until_code(codes.OK, send, key)
            report = w.until_code(code_of(codes, fault, topic), lambda case=case: send(case), key)
            assert words in report.message
            assert len(report.message) < 1000
            if codes is Status:
                assert not w.command().any()
                check(w)
            else:
                assert not report.force_closure
        w.until_code(codes.OK, send, key)


def test_halts_on_invalid_stamps_and_on_the_other_type_of_twists(monkeypatch):
    node = manipulation(use_stamped_twist=True)
    with world(node, twist_type=TwistStamped) as w:

        def send(age=0.0, frame='truss'):
            w.probe.send_measured()
            header = make_header(w.probe.past(age), frame)
            twist = to_twist_message((0.0, 0.02, 0.0))
            w.probe.twists.publish(TwistStamped(header=header, twist=twist))

        for about, code, words in (
            ({'age': 1.0}, Status.HALT_NO_TWIST, 'old'),
            ({'age': -1.0}, Status.HALT_INVALID_TWIST, 'future'),
            ({'frame': 'map'}, Status.HALT_INVALID_TWIST, "must be in 'truss'"),
        ):
            for frame in ('', 'truss'):
                w.until_code(Status.OK, lambda frame=frame: send(frame=frame))
            status = w.until_code(code, lambda about=about: send(**about))
            assert words in status.message
        w.until_code(Status.OK, send)
        check(w)
        # DDS admits one type of a topic in a process.
        other = SimpleNamespace(topic_type='geometry_msgs/msg/Twist')
        monkeypatch.setattr(Node, 'get_publishers_info_by_topic', lambda *_: [other])
        status = w.until_code(Status.HALT_INVALID_TWIST, lambda: None)
        assert 'publish TwistStamped, or set use_stamped_twist to false' in status.message


@robots.examples(150)
@given(
    names=st.one_of(
        st.just(NAMES), st.permutations(NAMES), st.lists(st.text(max_size=9), max_size=8)
    ),
    positions=st.one_of(st.lists(values, min_size=N, max_size=N), rows),
    speeds=st.one_of(st.just([]), st.lists(values, min_size=N, max_size=N), rows),
    center=st.tuples(values, values),
    twist=st.tuples(values, values, values),
)
def test_any_numbers_move_the_rollers_within_limits(names, positions, speeds, center, twist):
    settings = ServoSettings(disc_grip(ROBOT.home, MODULE), period=0.005, timeout=0.2)
    servo = TwistServo(ROBOT, settings)
    message = JointState(name=list(names), position=positions, velocity=speeds)
    parts = RollerParts(NAMES)
    try:
        parts.take(read_roller_part(message, NAMES), 0.0, 0.0)
        servo.receive(rollers=parts.merged())
    except MessageError as error:
        servo.receive(rollers=RejectedInput(str(error)))
    for x, y in (CENTER, center):
        servo.receive(pose=StampedInput(Pose(x, y, 0.0), 0.0))
        for velocity in ((0.0, 0.02, 0.0), twist):
            if not all(map(math.isfinite, (x, y, *velocity))):
                continue  # refused by the readers of messages
            servo.receive(twist=StampedInput(velocity, 0.0))
            decision = servo.decide(0.0)
            check_command(decision.command.roller_velocities, decision.command.status)
            assert 0.0 <= decision.command.scale <= 1.0


def test_the_simulated_robot_stops_on_invalid_commands():
    cases = [[math.nan] * N, [math.inf] * N, [], [0.01] * (N - 1), [0.01] * FOREVER]
    with world(lambda: Simulator(overrides(command_timeout=5.0))) as w:

        def moving():
            joints = w.probe.last('joints')
            return joints is not None and joints.velocity[1] > 0.0

        def send(speed):
            return lambda: w.probe.send_command([0.0, speed, *[0.0] * (N - 2)])

        for data in cases:
            w.until(moving, send(0.01))
            w.until(lambda: not moving(), lambda data=data: w.probe.send_command(data))
        for speed in HUGE:
            w.spin(0.05, send(speed))
        joints = w.probe.last('joints')
        assert np.isfinite([*joints.position, *joints.velocity]).all()
        assert np.abs(joints.velocity).max() <= 1.0  # the simulated rollers' limit


def test_invalid_requests_of_an_analysis_get_the_reason():
    good = {'x': CENTER[0], 'y': CENTER[1], 'diameter': 0.3, 'friction': 0.5, 'force': 0.0}
    good |= {'roller': 0.0}
    with world(lambda: GraspAnalysisNode()) as w:
        for name, value in itertools.product(good, BAD):
            numbers = good | {name: value}
            request = AnalyzeGrasp.Request(
                center=Point(x=numbers['x'], y=numbers['y']),
                diameter=numbers['diameter'],
                friction=numbers['friction'],
                roller_positions=[numbers['roller']] + [0.0] * (N - 1),
            )
            request.external_wrench.force.x = numbers['force']
            answer = w.call('analyze_grasp', request)
            codes = GraspCode.INVALID_REQUEST, GraspCode.NO_CONFIGURATION
            expected = codes[name == 'roller']
            assert (answer.success, answer.state.code) == (False, expected), (name, value)
            assert answer.message
            assert not answer.state.force_closure


def parameter_values():
    """Return one value of every type of parameter, and numbers that cannot be."""
    return [
        ParameterValue(),
        ParameterValue(type=1, bool_value=True),
        ParameterValue(type=2, integer_value=-(2**63)),
        *(ParameterValue(type=3, double_value=v) for v in (*BAD, *HUGE, -1.0)),
        ParameterValue(type=4, string_value='nobody' * 1000),
        ParameterValue(type=5, byte_array_value=[b'\xff'] * 1000),
        ParameterValue(type=6, bool_array_value=[True]),
        ParameterValue(type=7, integer_array_value=[2**63 - 1]),
        ParameterValue(type=8, double_array_value=list(BAD)),
        ParameterValue(type=9, string_array_value=['nobody', '']),
    ]


@pytest.mark.parametrize(
    'kind', [Manipulation, Simulator, GraspAnalysisNode, PathFollower, GraspPlanner]
)
def test_invalid_parameters_are_rejected_at_run_time(kind):
    with world(lambda: kind()) as w:
        node = w.nodes[1]
        names = list(node.get_parameters_by_prefix(''))
        before = {name: node.get_parameter(name).value for name in names}
        # True is a good value of these.
        may = {'require_emergency_stop', 'slide_along_limits', 'smooth_path'}
        for value in parameter_values():
            changes = [ParameterMessage(name=name, value=value) for name in [*names, 'nobody']]
            if value.type == 1:
                changes = [change for change in changes if change.name not in may]
            request = SetParameters.Request(parameters=changes)
            answer = w.call(f'{node.get_name()}/set_parameters', request)
            assert not any(result.successful for result in answer.results), value
            assert all(result.reason for result in answer.results)
        assert {name: node.get_parameter(name).value for name in names} == before
        if kind is Manipulation:
            w.until_code(Status.OK, w.probe.send_all)
