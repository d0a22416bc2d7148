# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator with MuJoCo as its plant: held, pulled at, dropped, under gravity."""

from isotruss_ros.mujoco_plant.recording import read_recording
from isotruss_ros.nodes.conversions.messages import read_stamp
from isotruss_ros.nodes.conversions.sensor_messages import read_joint_markers
from isotruss_ros.nodes.simulator.node import Simulator
from manual_world import check_refused, world
from mujoco_worlds import needs_mujoco
import numpy as np
from probe import maker, N, ROBOT
from sensor_msgs.msg import MultiDOFJointState

#: The object is pressed into the grip.
node = maker(Simulator, plant='mujoco', friction=0.8, indentation=0.01, rate=100.0)


def drive(w, velocities):
    return lambda: w.probe.send_command(velocities)


@needs_mujoco
def test_a_load_displaces_the_object_and_a_larger_one_removes_it():
    with world(node()) as w:
        w.until(lambda: len(w.probe.seen['pose']) > 50)
        start = w.place()[:2]
        w.until(
            lambda: w.place()[0] - start[0] > 1e-4, lambda: w.probe.send_wrench((1.0, 0.0, 0.0))
        )
        w.until(
            lambda: w.place()[1] - start[1] < -0.2, lambda: w.probe.send_wrench((0.0, -60.0, 0.0))
        )
        w.until(lambda: 'not held' in w.probe.last('diagnostics').status[0].message)


@needs_mujoco
def test_rollers_have_the_faults_of_the_other_plants():
    faults = {'roller_slip': 0.3, 'stuck_roller': ROBOT.roller_names[2]}
    with world(node(**faults)) as w:
        w.probe.listen(MultiDOFJointState, 'truth', 'truth/joint_markers')
        w.until(lambda: w.probe.last('truth') is not None)
        start = read_joint_markers(w.probe.last('truth'), ROBOT)['R']
        w.until(lambda: w.travel()[1] > 0.01, drive(w, [0.02] * N))
        assert w.travel()[2] == 0.0
        moved = np.subtract(read_joint_markers(w.probe.last('truth'), ROBOT)['R'], start)
        joint = ROBOT.topology.joint_names.index('R')
        unslipped = (ROBOT.configuration(w.travel()).nodes - ROBOT.home.nodes)[joint]
        share = np.linalg.norm(moved) / np.linalg.norm(unslipped)
        assert 1.0 - 1.5 * 0.3 < share < 1.0 - 0.5 * 0.3


@needs_mujoco
def test_states_are_recorded_with_the_time_of_the_messages(tmp_path):
    path = tmp_path / 'states'
    with world(node(recording=str(path))) as w:
        w.until(lambda: len(w.probe.seen['pose']) > 30)
        recording = read_recording(path)  # while it grows
        stamps = [read_stamp(message.header) for _, message in w.probe.seen['joints']]
        assert stamps[0] <= recording.times[0] + 0.05
        assert recording.times[-1] <= stamps[-1] + 0.05
    check_refused(node(plant='elastic', recording=str(path)), 'recording')
    check_refused(node(recording=str(tmp_path / 'no' / 'states')), 'cannot be written')
