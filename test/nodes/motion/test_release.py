# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Speed of the rollers while the grip of a placed object opens."""

from isotruss_msgs.action import FollowRollerTrajectory, PlaceObject
from isotruss_msgs.msg import GraspState
from isotruss_ros.core import tangent_center
from isotruss_ros.core.planning.grasp_plan import NEAR_SPEED_SHARE
from isotruss_ros.nodes.conversions.path_messages import read_duration
from isotruss_ros.nodes.pick_and_place import action_steps
from isotruss_ros.nodes.pick_and_place.node import PickAndPlace
from manual_actions import MotionClient
from manual_world import world
import numpy as np
from probe import DIAMETER, maker, MODULE, ROBOT

HELD = tangent_center(ROBOT.home, MODULE, DIAMETER, shift=0.01)


def test_the_grip_opens_slowly_until_the_object_is_free(monkeypatch):
    client = MotionClient(FollowRollerTrajectory.Result())
    monkeypatch.setattr(action_steps, 'ActionClient', lambda *_: client)
    with world(maker(PickAndPlace, command_timeout=1.0, friction=0.8)()) as w:

        def send():
            w.probe.send_joints()
            w.probe.send_pose(center=HELD)
            w.probe.send_held(GraspState.HELD_YES, ['north/P-Z', 'north/Z-R'])

        w.spin(0.1, send)
        w.send_goal(PlaceObject.Goal())
        w.until(lambda: client.goal is not None, send)
    points = client.goal.trajectory.points
    times = [read_duration(point.time_from_start) for point in points]
    steps = np.diff([point.positions for point in points], axis=0)
    speeds = np.abs(steps).max(axis=1) / np.diff(times)
    fastest = ROBOT.description.max_speed
    assert speeds[0] < 1.001 * NEAR_SPEED_SHARE * fastest
    assert speeds.max() > 2.0 * NEAR_SPEED_SHARE * fastest
