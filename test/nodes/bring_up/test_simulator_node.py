# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator node, and both nodes together, under an executor in this process."""

from isotruss_ros.nodes.conversions.messages import read_stamp
from isotruss_ros.nodes.simulator.node import Simulator
from manual_world import world
import numpy as np
from probe import CENTER, maker, N, ROBOT
import pytest

SPEED = 0.02


node = maker(Simulator)


def only(roller, speed=SPEED):
    """Return a command in which one roller moves."""
    velocities = np.zeros(N)
    velocities[roller] = speed
    return velocities


def test_publishes_state_and_pose_of_home():
    with world(node(rate=50.0)) as w:
        w.until(lambda: len(w.probe.seen['pose']) > 20)
        joints, pose = w.probe.last('joints'), w.probe.last('pose')
        assert tuple(joints.name) == ROBOT.roller_names
        assert list(joints.position) == [0.0] * N
        assert list(joints.velocity) == [0.0] * N
        assert pose.header.frame_id == 'truss'
        assert (pose.pose.position.x, pose.pose.position.y) == pytest.approx(CENTER)
        stamps = [read_stamp(message.header) for _, message in w.probe.seen['joints']]
        assert np.mean(np.diff(stamps)) > 0.014  # a busy machine is only slower


def test_travel_is_the_integral_of_the_commands():
    with world(node()) as w:
        w.until(lambda: w.probe.last('joints') is not None)
        w.until(lambda: w.travel()[1] > 0.003, lambda: w.probe.send_command(only(1)))
        joints = w.probe.last('joints')
        assert joints.velocity[1] == pytest.approx(SPEED)
        assert not w.travel()[[0, 2, 3, 4, 5]].any()
        moving = [m for _, m in w.probe.seen['joints'] if m.velocity[1] > 0.0]
        elapsed = read_stamp(moving[-1].header) - read_stamp(moving[1].header)
        assert moving[-1].position[1] - moving[1].position[1] == pytest.approx(
            SPEED * elapsed,
            abs=2e-8,  # a float holds the time since 1970 to 2e-7 s
        )


def test_a_command_that_is_not_renewed_ends():
    timeout = 0.153  # between two cycles
    with world(node(command_timeout=timeout)) as w:
        w.until(lambda: w.travel()[0] > 0.0, lambda: w.probe.send_command(only(0)))
        sent = [t for t, message in w.probe.seen['command'] if any(message.data)]
        w.until(lambda: w.probe.last('joints').velocity[0] == 0.0)
        stopped = w.travel()[0]
        assert stopped == pytest.approx(SPEED * (timeout + sent[-1] - sent[0]), abs=1e-7)
        w.spin(0.1)
        assert w.travel()[0] == stopped


def test_blocks_at_impossible_configurations_and_continues():
    with world(node()) as w:
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
