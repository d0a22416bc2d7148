# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator node: its rollers, objects and plants, and what it publishes of them."""

from functools import partial

from geometry_msgs.msg import PoseStamped, WrenchStamped
from held_grips import ANGLE, APART, box_between, BOX_FILE, DEPTH, HOME
from isotruss_ros.core import Disc, place_between, Pose, solve_twist
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.mujoco_plant.recording import read_recording
from isotruss_ros.nodes.conversions.messages import read_stamp, to_pose_message
from isotruss_ros.nodes.conversions.sensor_messages import read_joint_markers
from isotruss_ros.nodes.simulator.node import Simulator
from isotruss_ros.nodes.simulator.simulated_sensors import SensorChannel
from manual_world import check_refused, world
from mujoco_worlds import needs_mujoco
import numpy as np
from probe import CENTER, DIAMETER, maker, MODULE, N, overrides, ROBOT
import pytest
from sensor_msgs.msg import JointState, MultiDOFJointState
from std_msgs.msg import Header

SPEED = 0.02
node = maker(Simulator)
#: Cycles of a simulated robot at 100 Hz [s].
TIMES = 0.01 * np.arange(1000)


def test_a_command_that_is_not_renewed_ends():
    timeout = 0.153  # between two cycles
    with world(node(command_timeout=timeout)) as w:
        command = [SPEED, *[0.0] * (N - 1)]
        w.until(lambda: w.travel()[0] > 0.0, lambda: w.probe.send_command(command))
        sent = [t for t, message in w.probe.seen['command'] if any(message.data)]
        w.until(lambda: w.probe.last('joints').velocity[0] == 0.0)
        stopped = w.travel()[0]
        assert stopped == pytest.approx(SPEED * (timeout + sent[-1] - sent[0]), abs=1e-7)
        w.spin(0.1)
        assert w.travel()[0] == stopped


def test_blocks_at_impossible_configurations_and_continues():
    with world(node(rate=50.0)) as w:
        push = np.zeros(N)
        push[0] = -2.0
        w.until(lambda: w.probe.last('joints') is not None)
        w.spin(1.5, lambda: w.probe.send_command(push))
        blocked = w.travel()
        assert ROBOT.configuration(blocked).member_lengths.min() > 0.0
        w.until(
            lambda: np.abs(w.travel() - blocked).max() > 1e-3,
            lambda: w.probe.send_command(-0.05 * push),
        )


#: The box is between its two sides.
HELD = {'object': BOX_FILE, 'grip': list(APART), 'indentation': DEPTH, 'rate': 50.0}
boxed = maker(Simulator, object_pose=[0.6, 0.3, ANGLE], **HELD)
elastic = maker(Simulator, plant='elastic', friction=0.8, indentation=0.025, rate=50.0)


@pytest.mark.parametrize('is_free', [False, True])
def test_the_box_is_carried_by_the_two_sides(is_free):
    start = np.array(box_between().body.pose)
    free = {'object_is_free': True, 'object_pose': [*start[:2], ANGLE]}
    command = solve_twist(HOME, box_between(), (0.02, 0.0, 0.0)).roller_velocities
    with world(boxed(**(free if is_free else {}))) as w:
        w.until(lambda: w.place() is not None)
        # Of a free one the equilibrium is found, near by.
        assert w.place() == pytest.approx(start, abs=3e-3 if is_free else 1e-9)
        start = w.place()
        if is_free:
            w.spin(0.2)
        w.until(lambda: w.place()[0] - start[0] > 0.01, lambda: w.probe.send_command(command))
        went = w.place() - start
        assert abs(went[1]) < 0.05 * went[0]
        assert abs(went[2]) < 0.05 * went[0]


def test_a_load_in_the_frame_of_the_turned_object_moves_it_and_lets_it_back():
    with world(elastic(object_pose=[0.6, 0.3, 0.5 * np.pi])) as w:
        w.until(lambda: w.place() is not None)
        start = w.place()[:2]
        assert start == pytest.approx(CENTER, abs=0.06)
        w.until(
            lambda: np.hypot(*(w.place()[:2] - start)) > 1e-4,
            lambda: w.probe.send_wrench((1.0, 0.0, 0.0), frame='truss_object'),
        )
        x, y = w.place()[:2] - start
        assert y > abs(x)
        w.until(
            lambda: np.hypot(*(w.place()[:2] - start)) < 1e-9,
            lambda: w.probe.send_wrench((0.0, 0.0, 0.0)),
        )


@pytest.mark.parametrize('plant', ['elastic', 'kinematic'])
def test_the_object_is_put_elsewhere(plant):
    with world(elastic(plant=plant)) as w:
        places = w.probe.create_publisher(PoseStamped, 'set_object_pose', 1)
        w.until(lambda: w.place() is not None)

        def put(x, y, frame='truss'):
            pose = to_pose_message(Pose(x, y, 0.0))
            places.publish(PoseStamped(header=Header(frame_id=frame), pose=pose))
            w.probe.seen['pose'].clear()
            w.until(lambda: w.place() is not None)
            return w.place()[:2]

        start = w.place()[:2]
        assert put(0.6, 0.3, 'map') == pytest.approx(start, abs=0.0)
        assert put(0.6, 0.3) == pytest.approx((0.6, 0.3))
        assert put(*start) == pytest.approx(start, abs=1e-3)


#: The object is pressed into the grip.
mujoco = maker(Simulator, plant='mujoco', friction=0.8, indentation=0.01, rate=100.0)


@needs_mujoco
def test_a_load_displaces_the_object_and_a_larger_one_removes_it():
    with world(mujoco()) as w:
        w.until(lambda: len(w.probe.seen['pose']) > 20)
        start, pull = w.place()[:2], w.probe.send_wrench
        w.until(lambda: w.place()[0] - start[0] > 1e-4, lambda: pull((1.0, 0.0, 0.0)))
        w.until(lambda: w.place()[1] - start[1] < -0.2, lambda: pull((0.0, -60.0, 0.0)))
        w.until(lambda: 'not held' in w.probe.last('diagnostics').status[0].message)


@needs_mujoco
def test_a_free_object_moves_only_under_a_load_above_the_friction_of_the_ground():
    with world(mujoco(object_is_free=True, object_pose=[0.6, 5.0, 0.0], ground_friction=2.0)) as w:
        w.until(lambda: w.place() is not None)
        for force, is_above in ((1.5, False), (3.0, True)):
            start = w.place()[0]
            w.spin(0.5, lambda force=force: w.probe.send_wrench((force, 0.0, 0.0)))
            assert (w.place()[0] - start > 1e-2) == is_above


@needs_mujoco
def test_rollers_have_the_faults_of_the_other_plants():
    faults = {'roller_slip': 0.3, 'stuck_roller': ROBOT.roller_names[2]}
    with world(mujoco(**faults)) as w:
        w.probe.listen(MultiDOFJointState, 'truth', 'truth/joint_markers')
        w.until(lambda: w.probe.last('truth') is not None)
        start = read_joint_markers(w.probe.last('truth'), ROBOT)['R']
        w.until(lambda: w.travel()[1] > 0.01, lambda: w.probe.send_command([0.02] * N))
        assert w.travel()[2] == 0.0
        moved = np.subtract(read_joint_markers(w.probe.last('truth'), ROBOT)['R'], start)
        joint = ROBOT.topology.joint_names.index('R')
        unslipped = (ROBOT.configuration(w.travel()).nodes - ROBOT.home.nodes)[joint]
        share = np.linalg.norm(moved) / np.linalg.norm(unslipped)
        assert 1.0 - 1.5 * 0.3 < share < 1.0 - 0.5 * 0.3


@needs_mujoco
def test_states_are_recorded_with_the_time_of_the_messages(tmp_path):
    path = tmp_path / 'states'
    with world(mujoco(recording=str(path))) as w:
        w.until(lambda: len(w.probe.seen['pose']) > 10)
        recording = read_recording(path)  # while it grows
        stamps = [read_stamp(message.header) for _, message in w.probe.seen['joints']]
        assert stamps[0] <= recording.times[0] + 0.05
        assert recording.times[-1] <= stamps[-1] + 0.05
    check_refused(mujoco(plant='elastic', recording=str(path)), 'recording')
    check_refused(mujoco(recording=str(tmp_path / 'no' / 'states')), 'cannot be written')


NIGHTLY = [needs_mujoco, pytest.mark.nightly]
PLANTS = ['kinematic', 'elastic', pytest.param('mujoco', marks=NIGHTLY)]
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
        w.probe.listen(WrenchStamped, 'forces', 'truth/contact_forces')
        place = w.probe.create_publisher(PoseStamped, 'set_object_pose', 10)
        away = PoseStamped(header=Header(frame_id='truss'))
        away.pose.position.x = away.pose.position.y = 5.0
        w.until(
            lambda: [m.wrench.force.x for _, m in w.probe.seen['forces'][-2:]] == [0.0, 0.0],
            lambda: place.publish(away),
        )
        assert {m.header.frame_id for _, m in w.probe.seen['forces'][-2:]} == set(frames)


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
