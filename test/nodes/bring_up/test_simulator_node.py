# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator node: its messages, its rollers, and the object in its plants."""

from geometry_msgs.msg import PoseStamped
from held_grips import ANGLE, APART, box_between, BOX_FILE, DEPTH, HOME
from isotruss_ros.core import Pose, solve_twist
from isotruss_ros.nodes.conversions.messages import read_stamp, to_pose_message
from isotruss_ros.nodes.simulator.node import Simulator
from manual_world import world
import numpy as np
from probe import CENTER, maker, N, ROBOT
import pytest
from std_msgs.msg import Header

SPEED = 0.02


node = maker(Simulator)


def only(roller, speed=SPEED):
    velocities = np.zeros(N)
    velocities[roller] = speed
    return velocities


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


def test_a_load_moves_the_object_and_lets_it_back():
    with world(elastic()) as w:
        w.until(lambda: w.place() is not None)
        start = w.place()[:2]
        assert start == pytest.approx(CENTER, abs=0.06)
        w.until(
            lambda: np.hypot(*(w.place()[:2] - start)) > 1e-4,
            lambda: w.probe.send_wrench((0.0, 1.0, 0.0)),
        )
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
