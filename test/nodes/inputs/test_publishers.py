# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages of other publishers, and faults between the simulated robot and the loop."""

import copy
from functools import partial
from unittest.mock import Mock

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped, Twist
from isotruss_ros.core import Pose, Status
from isotruss_ros.nodes.conversions.messages import make_header, read_stamp, to_pose_message
from isotruss_ros.nodes.framework.commands import RollerCommands, TOPIC
from isotruss_ros.nodes.framework.cycle import PacedExecutor
from isotruss_ros.nodes.framework.runner import StoppableNode
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.simulator.node import Simulator
from isotruss_ros.nodes.state_estimator import StateEstimatorNode
from manual_world import moving_world, world
from nightly import some_now
import numpy as np
from probe import begin_context, CENTER, DEADLINE, maker, manipulation, N, overrides, planar, ROBOT
import pytest
import rclpy
from rclpy.qos import QoSProfile
from sensor_msgs.msg import FluidPressure, JointState, MultiDOFJointState
from std_msgs.msg import Float64MultiArray

NAMES = list(ROBOT.roller_names)
MOVING = (Status.OK, Status.ACCELERATING)
OWN = [1, 2, 3]


def second_tracker(w, beside, ahead=0):
    """Return a function that sends a pose beside the true one by another publisher [m]."""
    poses = w.probe.create_publisher(PoseStamped, 'object_pose', 1)

    def send():
        pose = to_pose_message(Pose(CENTER[0] + beside, CENTER[1], 0.3))
        poses.publish(PoseStamped(header=make_header(w.probe.past(0.0), 'truss'), pose=pose))

    for _ in range(ahead):  # numbers far from those of the first publisher
        send()
    return send


@pytest.mark.parametrize(('beside', 'ahead'), some_now([(0.005, 300), (0.05, 0)]))
def test_two_trackers_are_named_with_their_values_and_halt_the_robot(beside, ahead):
    with moving_world() as w:
        send = second_tracker(w, beside, ahead)
        w.until_code(Status.HALT_INVALID_OBJECT_POSE, lambda: (w.probe.send_all(), send()))
        words = w.probe.last('status').message
        assert words.count('publishers') == 1
        assert 'object_pose has 2 publishers (/probe, /probe), of which two send' in words
        for x in (CENTER[0], CENTER[0] + beside):
            assert f'({x:.4g}, {CENTER[1]:.4g})' in words
        conflict = partial(w.detail, 'conflicting publishers')
        w.until(lambda: '2 publishers' in conflict(), lambda: (w.probe.send_all(), send()))
        assert w.report('manipulation').level == DiagnosticStatus.ERROR
        w.until_code(Status.OK, w.probe.send_all)


def test_pose_of_another_tracker_is_never_used():
    with world(maker(StateEstimatorNode)()) as w:
        send, received = second_tracker(w, 0.005, 300), set()

        def turn():
            w.probe.send_measured()
            received.add(w.nodes[1].inputs.pose.value.x)
            send()

        w.spin(0.1, w.probe.send_measured)
        w.spin(0.5, turn)
        assert received == {CENTER[0]}


def test_publisher_that_takes_over_is_accepted():
    with moving_world() as w:
        take_over = second_tracker(w, 0.0)
        w.spin(0.5, lambda: (w.probe.send_joints(), w.probe.send_twist(), take_over()))
        codes = {message.code for _, message in w.probe.seen['status'][-50:]}
        assert codes <= {*MOVING}


def test_two_publishers_of_the_same_rollers_halt_the_robot_and_are_named():
    with moving_world() as w:
        states = w.probe.create_publisher(JointState, 'joint_states', 1)

        def send():
            w.probe.send_all()
            header = make_header(w.probe.past(0.0))
            states.publish(JointState(header=header, name=NAMES, position=[0.01] * N))

        status = w.until_code(Status.HALT_INVALID_JOINT_STATES, send)
        w.spin(0.2, send)
        assert f'joint_states of {NAMES[0]} has 2 publishers' in w.probe.last('status').message
        assert 'send 0 and 0.01' in status.message or 'send 0.01 and 0' in status.message


def test_two_publishers_of_twists_are_reported_and_the_last_twist_is_executed():
    with world(manipulation()) as w:
        twists = w.probe.create_publisher(Twist, 'cmd_vel', 1)
        w.spin(1.0, lambda: (w.probe.send_all(), twists.publish(Twist())))
        status = w.probe.last('status')
        assert status.code < Status.HALT_NO_TWIST
        assert 'cmd_vel has 2 publishers' in status.message
        assert w.report('manipulation').level == DiagnosticStatus.WARN


def send_gripper(w, *ages):
    for age in ages:
        w.probe.send_joints(age, name=['gripper'], position=[0.0])


def test_joint_states_of_a_gripper_alone_are_named():
    with world(manipulation()) as w:
        status = w.until_code(
            Status.HALT_INVALID_JOINT_STATES,
            lambda: (w.probe.send_pose(), w.probe.send_twist(), send_gripper(w, -0.02)),
        )
        assert "joint states of 'gripper': must name south/P" in status.message


def test_markers_and_pressures_of_other_bodies_are_not_judged():
    with world(maker(StateEstimatorNode, rate=20.0)()) as w:
        markers = w.probe.create_publisher(MultiDOFJointState, 'joint_markers', 1)

        def send():
            w.probe.send_measured()
            w.probe.send_pressures([2e4] * 3)
            send_gripper(w, -0.02, 3600.0)
            for age in (-0.02, 3600.0):
                header = make_header(w.probe.past(age), 'compressor')
                w.probe.gauges.publish(FluidPressure(header=header, fluid_pressure=8e5))
                header = make_header(w.probe.past(age), 'truss')
                markers.publish(MultiDOFJointState(header=header))

        w.spin(0.3, send)
        inputs = w.nodes[1].inputs
        assert inputs.rollers.rejected is None
        assert inputs.pressures.value == (2e4,) * 3
        assert inputs.pressures.rejected is None


class CommandingNode(StoppableNode):
    """Executes callbacks, one of each subscription in a turn."""

    node_name = 'commanding'
    specs = ()


def find_others(numbers):
    """Publish three times, receive messages with such numbers, and return who else commands."""
    commands = RollerCommands(Mock(), N)
    for _ in OWN:
        commands.stop()
    for number in numbers:
        commands.note({'publication_sequence_number': number})
    return commands.find_others()


@pytest.mark.parametrize('numbers', [[], OWN, [2], [1, 3], [None, None, None, None]])
def test_own_commands_are_not_those_of_others(numbers):
    assert find_others(numbers) is None


@pytest.mark.parametrize('other', [1, 2, 3, 4, 1000])
@pytest.mark.parametrize('place', range(4))
def test_a_command_of_another_node_is_noticed_whatever_its_number(other, place):
    assert 'another node publishes' in find_others([*OWN[:place], other, *OWN[place:]])


def test_commands_of_another_node_are_noticed_behind_own_ones_of_the_same_rate():
    begin_context()
    node = CommandingNode()
    try:
        commands, other = RollerCommands(node, N), node.advertise(Float64MultiArray, TOPIC)
        commands.subscribe()
        executor = PacedExecutor(node)
        for _ in range(20):
            commands.stop()
            other.publish(Float64MultiArray(data=[0.0] * N))
            executor.spin_once(DEADLINE)
        assert commands.find_others() is not None
    finally:
        node.destroy_node()
        rclpy.shutdown()


def test_commands_of_another_publisher_count_until_it_is_quiet():
    with world(manipulation(rate=50.0)) as w:
        w.until_code(Status.HALT_OTHER_COMMANDS, lambda: w.probe.send_command([0.0] * N))
        w.until_code(Status.HALT_NO_TWIST, lambda: None)


TIMEOUT = 0.2
#: From the timeout of an input to the rollers at rest: some cycles [s].
SLACK = 0.03
TWIST = (0.012, 0.016, 0.05)
TOPICS = {'joint_states': JointState, 'object_pose': PoseStamped}
REMAPS = {('simulator', f'/{topic}'): f'/true/{topic}' for topic in TOPICS}


class Relay:
    """
    Hands on what the simulator publishes, distorted once it is told to.

    :param topic: the one that is distorted; the other goes on as it is.
    :param distort: returns what is sent in place of the last one of those received since then.
    """

    def __init__(self, w, topic, distort):
        self.distorting, self._received = False, []
        self.true = {name: [] for name in TOPICS}
        for name, kind in TOPICS.items():
            send = w.probe.create_publisher(kind, name, QoSProfile(depth=50)).publish

            def hand_on(message, name=name, send=send):
                self.true[name].append(message)
                sent = [message]
                if self.distorting and name == topic:
                    self._received.append(copy.deepcopy(message))
                    sent = distort(self._received)
                for changed in sent:
                    send(changed)

            w.probe.create_subscription(kind, f'true/{name}', hand_on, 50)

    def poses(self, begin=0.0):
        """Return times and true (x, y, angle) of the object from a time on."""
        since = [m for m in self.true['object_pose'] if read_stamp(m.header) >= begin]
        return np.array([read_stamp(m.header) for m in since]), np.array(list(map(planar, since)))

    def speed(self):
        """Return the largest true speed of any roller now."""
        return max(map(abs, self.true['joint_states'][-1].velocity))


def relayed():
    """Return a context manager of a moving robot whose states can be distorted."""
    settings = overrides(command_timeout=TIMEOUT)
    return world(lambda: Simulator(settings), lambda: Manipulation(settings), remaps=REMAPS)


def send(w):
    return lambda: w.probe.send_twist(TWIST)


#: Topic, and the messages that are sent in place of the last one of those received since.
HARMLESS = {
    'out of order': ('joint_states', lambda received: received[:-3:-1] * (len(received) % 2 == 0)),
    'repeated late': ('joint_states', lambda received: [received[-1], received[-5:][0]]),
    'pose delayed a little': ('object_pose', lambda received: received[-4:-3]),
    'sent twice': ('joint_states', lambda received: 2 * received[-1:]),
    'pose repeated late': ('object_pose', lambda received: [received[-1], received[-5:][0]]),
}


@pytest.mark.parametrize('name', some_now(HARMLESS, 3))
def test_moves_as_commanded_in_spite_of_harmless_faults(name):
    topic, distort = HARMLESS[name]
    with relayed() as w:
        relay = Relay(w, topic, distort)
        w.until_code(Status.OK, send(w))
        relay.distorting = True
        w.probe.seen['status'].clear()
        begin = read_stamp(relay.true['object_pose'][-1].header)
        w.until(lambda: read_stamp(relay.true['object_pose'][-1].header) > begin + 0.4, send(w))
        assert {m.code for _, m in w.probe.seen['status']} == {Status.OK}
        times, places = relay.poses(begin)
        elapsed = times[-1] - times[0]
        assert places[-1] - places[0] == pytest.approx(np.array(TWIST) * elapsed, abs=1e-3)


def moved(by):
    def distort(received):
        received[-1].pose.position.x += by
        return received[-1:]

    return distort


def delay(received):
    return received[-101:-100]


HARMFUL = {
    'frozen': ('joint_states', lambda received: received[:1], Status.HALT_STALE_JOINT_STATES),
    'delayed a lot': ('joint_states', delay, Status.HALT_STALE_JOINT_STATES),
    'pose delayed a lot': ('object_pose', delay, Status.HALT_STALE_OBJECT_POSE),
    'pose teleported': ('object_pose', moved(1.0), Status.HALT_NO_GRASP),
}


@pytest.mark.parametrize('name', HARMFUL)
def test_stops_within_the_timeout_and_resumes(name):
    topic, distort, code = HARMFUL[name]
    with relayed() as w:
        relay = Relay(w, topic, distort)
        w.until_code(Status.OK, send(w))
        w.until(lambda: relay.speed() > 0.0, send(w))
        relay.distorting = True
        began = w.now
        w.until_code(code, send(w))
        w.until(lambda: relay.speed() == 0.0, send(w))
        assert w.now - began < TIMEOUT + SLACK + 1e-9
        count = len(relay.true['joint_states'])
        w.until(lambda: len(relay.true['joint_states']) > count + 20, send(w))
        assert not any(any(m.velocity) for m in relay.true['joint_states'][count:])
        relay.distorting = False
        w.until_code(Status.OK, send(w))
        w.until(lambda: relay.speed() > 0.0, send(w))


def test_an_object_that_jumps_in_the_grasp_is_moved_from_its_new_pose():
    with relayed() as w:
        relay = Relay(w, 'object_pose', moved(-0.02))
        w.until_code(Status.OK, send(w))
        relay.distorting = True
        count = len(w.probe.seen['status'])
        w.until(lambda: len(w.probe.seen['status']) > count + 50, send(w))
        commands = np.array([m.data for _, m in w.probe.seen['command']])
        assert np.isfinite(commands).all()
        assert np.abs(commands).max() <= ROBOT.description.max_speed + 1e-9
        assert w.code() < Status.HALT_NO_TWIST
