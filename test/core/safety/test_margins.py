# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parts of the robot that may touch the object of a grip."""

from isotruss_ros.core import ConvexObject, Grip, load_robot
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.safety.margins import object_distances
import numpy as np
import pytest


def test_distances_leave_out_grasping_members_their_meeting_module_and_the_rods_at_its_joint():
    config = load_robot('nine_member').home
    topology = config.robot.topology
    first, meeting = 0, topology.following[0]
    members = tuple(topology.member_names[i] for i in (first, meeting))
    rods = np.flatnonzero(topology.joint == topology.joint[meeting])
    count = topology.n_modules
    expected = {first, meeting, count + meeting, *(2 * count + rods)}

    distances = object_distances(config, ConvexObject.disc((0.0, 0.0), 0.2), members)

    assert set(np.flatnonzero(np.isinf(distances))) == expected


@pytest.mark.parametrize('module', load_robot('nine_member').module_names)
def test_rods_at_the_joint_of_the_grip_alone_may_touch_the_object(module):
    robot = load_robot('nine_member')
    members = Grip.at_module(robot, module, ConvexObject.disc((0.0, 0.0), 0.1)).members
    starts, ends = collision_model(robot).part_ends(robot.home, slice(None))
    for rod, name in enumerate(robot.module_names, start=2 * len(robot.module_names)):
        middle = 0.5 * (starts[rod] + ends[rod])
        on_rod = ConvexObject.disc((middle.real, middle.imag), 0.02)
        may_touch = name.split('/')[1] == module.split('/')[1]
        assert (object_distances(robot.home, on_rod, members)[rod] < 0.0) != may_touch
