# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the simulator publishes of its robot: with the faults of its sensors, and the truth."""

from functools import partial

from geometry_msgs.msg import PoseStamped, WrenchStamped
from isotruss_ros.core import Disc, place_between
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.nodes.conversions.messages import read_stamp
from isotruss_ros.nodes.simulator.node import Simulator
from isotruss_ros.nodes.simulator.simulated_sensors import SensorChannel
from manual_world import world
from mujoco_worlds import needs_mujoco
import numpy as np
from probe import DIAMETER, MODULE, overrides, ROBOT
import pytest
from sensor_msgs.msg import JointState, MultiDOFJointState

PLANTS = ['kinematic', 'elastic', pytest.param('mujoco', marks=needs_mujoco)]
TOPICS = (
    (JointState, 'joint_states'),
    (PoseStamped, 'object_pose'),
    (MultiDOFJointState, 'joint_markers'),
    (PoseStamped, 'truth/object_pose'),
    (MultiDOFJointState, 'truth/joint_markers'),
    (WrenchStamped, 'truth/contact_forces'),
)
DELAYS = {'joint_states': 0.01, 'object_pose': 0.03, 'joint_markers': 0.03}


def receive(w, duration=1.0):
    """Return (time of arrival, message) by topic."""
    received = {topic: [] for _, topic in TOPICS}

    def keep(topic, message):
        received[topic].append((w.probe.past(0.0), message))

    for kind, topic in TOPICS:
        w.probe.create_subscription(kind, topic, partial(keep, topic), 10)
    w.spin(duration)
    return received


def places(message):
    return {
        name: np.array([transform.translation.x, transform.translation.y])
        for name, transform in zip(message.joint_names, message.transforms, strict=True)
    }


@pytest.mark.parametrize('plant', PLANTS)
def test_delay_and_rate_of_sensors_are_those_of_the_parameters(plant):
    faults = {'encoder_delay': 0.01, 'tracker_delay': 0.03, 'tracker_rate': 20.0}
    values = {'plant': plant, 'indentation': 0.005, 'marker_joints': ['all']}
    with world(lambda: Simulator(overrides(**values, **faults))) as w:
        received = receive(w)
        for topic, delay in DELAYS.items():
            ages = [came - read_stamp(m.header) for came, m in received[topic]]
            assert np.array(ages) == pytest.approx(delay, abs=2e-3)
        counts = [len(received[topic]) for topic in DELAYS]
        assert counts == pytest.approx([99, 20, 20], abs=2)


def test_the_noise_of_the_tracker_is_that_of_its_parameter():
    values = {'plant': 'elastic', 'indentation': 0.005, 'marker_joints': ['all']}
    with world(lambda: Simulator(overrides(tracker_noise=2e-3, **values))) as w:
        received = receive(w, 3.0)
        placed, true = (
            np.array([(m.pose.position.x, 2.0 * m.pose.orientation.z) for _, m in received[topic]])
            for topic in ('object_pose', 'truth/object_pose')
        )
        assert (placed - true).std(axis=0) == pytest.approx([2e-3, 0.02], rel=0.2)
        marked = np.array([places(m)['Z'] for _, m in received['joint_markers']])
        assert marked.std(axis=0) == pytest.approx(2e-3, rel=0.2)


def test_encoder_readings_are_multiples_of_the_resolution():
    with world(lambda: Simulator(overrides(encoder_step=1e-3))) as w:
        command = [0.02] + [0.0] * (len(ROBOT.roller_names) - 1)
        w.until(lambda: w.travel()[0] > 5e-3, lambda: w.probe.send_command(command))
        steps = [message.position[0] / 1e-3 for _, message in w.probe.seen['joints']]
        assert len(set(steps)) > 4
        assert steps == pytest.approx(np.round(steps))


def test_true_states_are_those_of_the_plant():
    faults = {'tracker_noise': 0.01, 'indentation': 0.005, 'friction': 0.8}
    with world(lambda: Simulator(overrides(plant='elastic', **faults))) as w:
        received = receive(w)
        members = members_at(ROBOT, MODULE)
        body = place_between(ROBOT.home, members, Disc(DIAMETER), indentation=0.005).body
        held = attach_grip(ROBOT.home, body)
        result = {
            message.header.frame_id: message.wrench.force.x
            for _, message in received['truth/contact_forces'][-2:]
        }
        frames = [f'truss_{name.replace("/", "_")}_contact' for name in held.member_names]
        assert result == pytest.approx(dict(zip(frames, held.normal_forces, strict=True)))
        position = received['truth/object_pose'][-1][1].pose.position
        assert (position.x, position.y) == pytest.approx(held.pose[:2])


#: Cycles of a simulated robot at 100 Hz [s].
TIMES = 0.01 * np.arange(1000)


def arrivals(seed=0, rows=1, **faults):
    """Return (time of arrival, time, values) of a quantity that is the time."""
    channel = SensorChannel((seed,))
    return [
        (now, *result)
        for now in TIMES
        for result in channel.measure(now, lambda now=now: np.full((rows, 2), now), **faults)
    ]


@pytest.mark.parametrize('rate', [7.0, 20.0, 30.0, 99.0])
def test_the_mean_rate_is_kept_where_it_does_not_divide_that_of_the_cycles(rate):
    assert len(arrivals(rate=rate)) == pytest.approx(10.0 * rate, abs=1)


def test_rows_are_lost_on_their_own_by_the_share_of_the_dropouts():
    seen = np.isfinite([values[:, 0] for *_, values in arrivals(rows=5, dropouts=0.3)])
    assert np.mean(seen) == pytest.approx(0.7, abs=0.03)
    assert len({tuple(row.tolist()) for row in seen}) > 10
    assert arrivals(rows=5, dropouts=1.0) == []


def test_the_noise_of_a_seed_is_the_same_with_dropouts_and_another_for_another_seed():
    noisy = {time: values for _, time, values in arrivals(4, noise=1.0)}
    gappy = arrivals(4, noise=1.0, dropouts=0.5)
    assert 400 < len(gappy) < 600
    assert all((noisy[time] == values).all() for _, time, values in gappy)
    assert (arrivals(5, noise=1.0)[0][2] != noisy[0.0]).all()
