# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parts of the robot that may touch the object of a grip."""

from held_grips import box_between, NINE
from isotruss_ros.core import (
    Configuration,
    ConvexObject,
    Grip,
    load_robot,
    RollingGrip,
    ShapeGuard,
    Status,
)
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.safety.margins import object_distances, shape_margins
from isotruss_ros.core.safety.shape_guard import ShapeBounds
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


GRIP = box_between()


def distances_after(travel):
    """Return the distances from the box after some roller travel [m]."""
    there = NINE.home.moved_to(travel)
    return object_distances(
        there, RollingGrip.attach(NINE.home, GRIP).moved_to(there).grip.body, GRIP.members
    )


def test_a_command_ends_before_a_contact_is_lost():
    watch = ShapeGuard(NINE, ShapeBounds(0.0, 0.0, 0.0, 1e-6, 1e-6)).watch(NINE.home, GRIP)
    away = np.array([0.25, -0.3, 0.3, 0.2, -0.3, 0.25])
    command = RollerCommand(away, np.array([0.1, 0.2, 0.3]), 1.0, Status.OK)
    kept = watch.keep(command, np.zeros(len(away)), 1.0)
    assert kept.status is Status.SLOWED_OBJECT
    assert kept.limiting == ('the contacts of the grip',)
    assert 0.0 < kept.scale <= 0.4
    assert distances_after(kept.roller_velocities).min() >= 0.0


def test_a_shape_on_a_line_is_not_rigid():
    robot = load_robot('triangle')
    flat = Configuration(robot, np.zeros(2), robot.home.points.real + 0j)
    assert shape_margins(flat).rigidity == 0.0
