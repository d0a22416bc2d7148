# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How far shapes are from singular and self-colliding ones: rigidity by a full decomposition."""

from hypothesis import given
from isotruss_ros.core import ConvexObject, Grip, load_robot
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.safety.barrier_law import ALL_VALUES, BarrierLaw
from isotruss_ros.core.safety.barriers import ClearanceBarrier
from isotruss_ros.core.safety.margins import object_distances, shape_margins
import numpy as np
import pytest
import robots


def test_members_that_hold_an_object_are_those_of_the_robot():
    body = ConvexObject.disc((0.0, 0.0), 0.1)
    with pytest.raises(GraspError, match='no such members'):
        object_distances(load_robot('nine_member').home, body, ('north/X',))


@robots.examples(25)
@given(robots.robots(), robots.generators())
def test_margins_are_the_least_distances_and_name_them(robot, rng):
    config = robots.far_state(robot, rng, 0.1)
    center = config.points[rng.integers(len(config.points))] + complex(*rng.uniform(-1, 1, 2))
    body = ConvexObject.disc((center.real, center.imag), float(rng.uniform(0.05, 0.5)))
    grip = Grip.at_module(robot, str(rng.choice(robot.module_names)), body)
    model = collision_model(robot)
    distances = model.distances(config)
    found = shape_margins(config)
    assert found.clearance == distances.min()
    assert found.nearest == model.names(np.array([distances.argmin()]))[0]
    distances = object_distances(config, body, grip.members)
    # It is what the guard goes by.
    barrier = ClearanceBarrier(robot, BarrierLaw(0.0, 1.0), needs_object=True)
    far = 1.5 * barrier.law.active_below
    near = distances < far
    values = barrier.values(config, grip, ALL_VALUES)
    assert (values[near] == distances[near]).all()
    assert (values[~near] >= far).all()


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
