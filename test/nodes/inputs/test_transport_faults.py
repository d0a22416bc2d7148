# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Faults between the simulated robot and the loop, in mid-motion.

Either the object moves as commanded all the same, or the rollers stand still within the time-out.
"""

import copy

from geometry_msgs.msg import PoseStamped
from isotruss_ros.core import Status
from isotruss_ros.nodes.conversions.messages import read_stamp
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.simulator.node import Simulator
from manual_world import world
from nightly import some_now
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
