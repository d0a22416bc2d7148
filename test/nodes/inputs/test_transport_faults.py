# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Faults between the simulated robot and the loop, in mid-motion.

Either the object moves as commanded all the same, or the rollers stand still within the time-out.
"""

from collections import deque
import copy

from geometry_msgs.msg import PoseStamped
from isotruss_ros.core import Status
from isotruss_ros.nodes.conversions.messages import read_stamp
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.simulator.node import Simulator
from manual_world import world
import numpy as np
from probe import overrides, planar, ROBOT
import pytest
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

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
    :param distort: turns a message into those that are sent in its place.
    """

    def __init__(self, w, topic, distort):
        self.distorting = False
        self.true = {name: [] for name in TOPICS}
        for name, kind in TOPICS.items():
            send = w.probe.create_publisher(kind, name, QoSProfile(depth=50)).publish

            def hand_on(message, name=name, send=send):
                self.true[name].append(message)
                distorted = self.distorting and name == topic
                for changed in distort(copy.deepcopy(message)) if distorted else [message]:
                    send(changed)

            w.probe.create_subscription(kind, f'true/{name}', hand_on, 50)

    def poses(self, begin=0.0):
        """Return times and true (x, y, angle) of the object from a time on."""
        since = [m for m in self.true['object_pose'] if read_stamp(m.header) >= begin]
        return np.array([read_stamp(m.header) for m in since]), np.array(list(map(planar, since)))

    def speed(self):
        """Return the largest true speed of any roller now."""
        return max(map(abs, self.true['joint_states'][-1].velocity))


def relayed(timeout):
    """Return a context manager of a moving robot whose states can be distorted."""
    settings = overrides(command_timeout=timeout)
    return world(lambda: Simulator(settings), lambda: Manipulation(settings), remaps=REMAPS)


def send(w):
    """Return a call that sends the twist."""
    return lambda: w.probe.send_twist(TWIST)


def frozen():
    """Repeat the first message, stamp and all."""
    kept = []

    def distort(message):
        kept.append(message)
        return [kept[0]]

    return distort


def delayed(count):
    """Hold messages back until so many more have come (5 ms each)."""
    waiting = deque()

    def distort(message):
        waiting.append(message)
        return [waiting.popleft()] if len(waiting) > count else []

    return distort


def swapped():
    """Let every second message overtake the one before."""
    waiting = []

    def distort(message):
        waiting.append(message)
        if len(waiting) < 2:
            return []
        pair = waiting[::-1]
        waiting.clear()
        return pair

    return distort


def repeated_late():
    """Repeat each message after four newer ones."""
    recent = deque(maxlen=5)

    def distort(message):
        recent.append(message)
        return [message, recent[0]]

    return distort


HARMLESS = {
    'sent twice': ('joint_states', lambda m: [m, m]),
    'out of order': ('joint_states', swapped()),
    'repeated late': ('joint_states', repeated_late()),
    'pose delayed a little': ('object_pose', delayed(3)),
    'pose repeated late': ('object_pose', repeated_late()),
}


@pytest.mark.parametrize('name', HARMLESS)
def test_moves_as_commanded_in_spite_of_harmless_faults(name):
    topic, distort = HARMLESS[name]
    with relayed(TIMEOUT) as w:
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


HARMFUL = {
    'frozen': ('joint_states', frozen, Status.HALT_STALE_JOINT_STATES),
    'delayed a lot': ('joint_states', lambda: delayed(100), Status.HALT_STALE_JOINT_STATES),
    'pose delayed a lot': ('object_pose', lambda: delayed(100), Status.HALT_STALE_OBJECT_POSE),
    'pose teleported': ('object_pose', lambda: moved(1.0), Status.HALT_NO_GRASP),
}


def moved(by):
    """Put the object elsewhere."""

    def distort(message):
        message.pose.position.x += by
        return [message]

    return distort


@pytest.mark.parametrize('name', HARMFUL)
def test_stops_within_the_timeout_and_resumes(name):
    topic, make_distort, code = HARMFUL[name]
    distort = make_distort()
    with relayed(TIMEOUT) as w:
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
    distort = moved(-0.02)
    with relayed(TIMEOUT) as w:
        relay = Relay(w, 'object_pose', distort)
        w.until_code(Status.OK, send(w))
        relay.distorting = True
        count = len(w.probe.seen['status'])
        w.until(lambda: len(w.probe.seen['status']) > count + 50, send(w))
        commands = np.array([m.data for _, m in w.probe.seen['command']])
        assert np.isfinite(commands).all()
        assert np.abs(commands).max() <= ROBOT.description.max_speed + 1e-9
        assert w.code() < Status.HALT_NO_TWIST
