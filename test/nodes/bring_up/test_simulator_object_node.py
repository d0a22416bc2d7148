# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator with an object of any shape, between any members, in its plants."""

from geometry_msgs.msg import PoseStamped
from held_grips import ANGLE, APART, box_between, BOX_FILE, DEPTH, HOME
from isotruss_ros.core import place_between, solve_twist
from isotruss_ros.core.simulation.elastic_object import ElasticObject
from isotruss_ros.nodes.conversions.messages import to_pose_message
from isotruss_ros.nodes.simulator.node import Simulator
from manual_world import world
import numpy as np
from probe import CENTER, maker
import pytest
from std_msgs.msg import Float64MultiArray

#: The box is between its two sides.
HELD = {'object': BOX_FILE, 'grip': list(APART), 'indentation': DEPTH, 'rate': 50.0}
node = maker(Simulator, object_pose=[0.6, 0.3, ANGLE], **HELD)
elastic = maker(Simulator, plant='elastic', friction=0.8, indentation=0.025, rate=50.0)


@pytest.mark.parametrize('is_free', [False, True])
def test_the_box_is_carried_by_the_two_sides(is_free):
    start = np.array(box_between().body.pose)
    free = {'object_is_free': True, 'object_pose': [*start[:2], ANGLE]}
    command = solve_twist(HOME, box_between(), (0.02, 0.0, 0.0)).roller_velocities
    with world(node(**(free if is_free else {}))) as w:
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


def test_a_free_box_stays_and_is_put_elsewhere_with_its_angle():
    with world(node(object_is_free=True, object_pose=[2.5, -0.5, 0.7])) as w:
        w.until(lambda: w.probe.last('joints') is not None and w.place() is not None)
        w.until(
            lambda: w.probe.last('joints').position[1] > 0.003,
            lambda: w.probe.send_command([0.02] * 6),
        )
        assert w.place() == pytest.approx((2.5, -0.5, 0.7))
        there = PoseStamped(pose=to_pose_message(box_between().body.pose))
        there.header.frame_id = 'truss'
        w.nodes[1]._set_object_pose(there)
        w.probe.seen['pose'].clear()
        w.until(lambda: w.place() is not None)
        assert w.place() == pytest.approx(np.array(box_between().body.pose), abs=3e-3)


def test_without_members_the_sides_of_the_module_hold_it():
    with world(node(grip=[''], grip_module='north/Z', object_pose=[0.6, 0.3, 0.3])) as w:
        w.until(lambda: w.place() is not None)
        shape = box_between().body.shape
        sides = ('north/Z-R', 'north/P-Z')
        expected = place_between(HOME, sides, shape, 0.3, DEPTH).body.pose
        assert w.place() == pytest.approx(np.array(expected), abs=1e-9)


def test_the_elastic_plant_holds_the_box():
    with world(node(plant='elastic')) as w:
        w.until(lambda: w.place() is not None)
        start = w.place()
        assert start == pytest.approx(np.array(box_between().body.pose), abs=0.005)
        _, simulator = w.nodes
        assert set(simulator._plant.elastic.grasp.member_names) == set(APART)
        command = solve_twist(HOME, box_between(), (0.02, 0.0, 0.0)).roller_velocities
        w.until(lambda: w.place()[0] - start[0] > 0.003, lambda: w.probe.send_command(command))


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
            message = PoseStamped()
            message.header.frame_id = frame
            message.pose.position.x, message.pose.position.y = x, y
            message.pose.orientation.w = 1.0
            places.publish(message)
            w.probe.seen['pose'].clear()
            w.until(lambda: w.place() is not None)
            return w.place()[:2]

        start = w.place()[:2]
        assert put(0.6, 0.3, 'map') == pytest.approx(start, abs=0.0)
        assert put(0.6, 0.3) == pytest.approx((0.6, 0.3))
        assert put(*start) == pytest.approx(start, abs=1e-3)
        if plant == 'elastic':
            assert w.nodes[1]._plant.elastic.grasp is not None


def test_one_equilibrium_is_solved_for_each_published_state(monkeypatch):
    configurations = []
    follow = ElasticObject.follow
    monkeypatch.setattr(
        ElasticObject,
        'follow',
        lambda self, there: (configurations.append(there), follow(self, there)),
    )
    command = 0.01 * np.ones(len(HOME.roller_positions))
    with world(elastic()) as w:
        w.until(lambda: w.probe.last('joints') is not None)
        configurations.clear()
        count, start = len(w.probe.seen['joints']), w.travel()
        w.until(  # three commands in each period
            lambda: w.travel()[0] > start[0] + 1e-3, lambda: w.probe.send_command(command), 7e-3
        )
        published = len(w.probe.seen['joints']) - count
    assert len(set(map(id, configurations))) == published


def test_the_object_follows_the_rollers_in_a_step_at_the_time_of_a_command():
    command = Float64MultiArray(data=[0.01] * len(HOME.roller_positions))
    with world(elastic()) as w:
        w.until(lambda: w.place() is not None)
        simulator = w.nodes[1]
        plant = simulator._plant
        simulator._receive_command(command)
        w.now += 0.1
        simulator._receive_command(command)
        before, speeds = np.array(plant.object_pose), plant.roller_velocities
        simulator._step(simulator.now())
        assert np.abs(plant.object_pose - before).max() > 2e-4
        assert plant.roller_velocities == pytest.approx(speeds)
        assert speeds.all()
