# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator with the elastic plant: held from the start, pulled at, dropped."""

from geometry_msgs.msg import PoseStamped
from isotruss_ros.nodes.simulator.node import Simulator
from manual_world import world
import numpy as np
from probe import CENTER, maker
import pytest

node = maker(Simulator, plant='elastic', friction=0.8, indentation=0.05, rate=50.0)


def test_a_load_moves_the_object_and_lets_it_back():
    with world(node()) as w:
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
    with world(node(plant=plant)) as w:
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
