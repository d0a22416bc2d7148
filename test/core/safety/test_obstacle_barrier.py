# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Barrier on distances from obstacles: derivatives, neighbour lists and clearances in motion."""

from dataclasses import replace

from contracts import check_barrier
from driven import Driven
from grips import held_at
from hypothesis import assume, given
from hypothesis import strategies as st
from isotruss_ros.core import ConvexObject, load_robot, Obstacle, Polygon, Status
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.safety.barrier_law import BarrierLaw
from isotruss_ros.core.safety.obstacle_barrier import ObstacleBarrier
import numpy as np
import pytest
import robots
from studies.comparison.rooms import clearance, random_room

#: So wide that everything is near.
ALL = BarrierLaw(0.0, 1e3)
ROBOT = load_robot('nine_member')
BOUND = 0.02
HELD = held_at(ROBOT.home, 'north/Z', 0.3)
AHEAD = Obstacle('post', ConvexObject.disc((HELD.pose.x, HELD.pose.y - 0.45), 0.2))


@pytest.mark.parametrize('needs_object', [False, True])
@robots.examples(12)
@given(rng=robots.generators())
def test_obstacle_barrier_keeps_the_contract_of_barriers(needs_object, rng):
    room = random_room(rng, HELD, wall=True)
    barrier = ObstacleBarrier(ROBOT, ALL, room, needs_object)
    check_barrier(barrier, HELD.config, HELD.grip, rng)


def test_drift_is_the_rate_of_the_distances_from_moving_obstacles():
    rng, step = np.random.default_rng(4), 1e-6
    room = [
        replace(obstacle, velocity=(*rng.uniform(-0.3, 0.3, 2), 0.5), stamp=0.0)
        for obstacle in random_room(rng, HELD, 5)
    ]
    for needs_object in (False, True):
        barrier = ObstacleBarrier(ROBOT, ALL, room, needs_object)
        near = barrier.active(HELD.config, HELD.grip)
        ahead, behind = (
            ObstacleBarrier(ROBOT, ALL, [o.at(time) for o in room], needs_object).values(
                HELD.config, HELD.grip, near.indices
            )
            for time in (step, -step)
        )
        assert near.drift == pytest.approx((ahead - behind) / (2.0 * step), abs=1e-4)


def test_active_values_depend_on_the_present_state_and_obstacles_alone():
    rng, law = np.random.default_rng(7), BarrierLaw(0.02, 0.1)
    room = random_room(rng, HELD, 6)
    moving = [replace(room.pop(), velocity=(0.1, 0.2, 0.0), stamp=0.0) for _ in range(2)]
    old = ObstacleBarrier(ROBOT, law, room, needs_object=False)
    config, count = ROBOT.home, 0
    way = rng.uniform(-1.0, 1.0, len(ROBOT.roller_names))
    for step in range(60):
        now = 0.01 * step
        config = ROBOT.home.moved_to(0.1 * np.sin(now) * way)
        there = [obstacle.at(now) for obstacle in moving]
        near = old.with_moving(there).active(config, None)
        fresh = ObstacleBarrier(ROBOT, law, [*room, *there], False).active(config, None)
        assert near.indices.tolist() == fresh.indices.tolist()
        assert near.values == pytest.approx(fresh.values, abs=1e-12)
        count += len(near.indices)
    assert count


def test_active_values_follow_an_obstacle_that_turns_in_place():
    beam = Polygon(((-0.4, -0.02), (0.4, -0.02), (0.4, 0.02), (-0.4, 0.02)))
    body = ConvexObject(beam, (HELD.pose.x, HELD.pose.y + 0.8, 0.0))
    law, counts = BarrierLaw(0.02, 0.1), set()
    turning = Obstacle('beam', body, (0.0, 0.0, 1.0), 0.0)
    old = ObstacleBarrier(ROBOT, law, [], needs_object=False)
    for now in np.linspace(0.0, 1.5, 40):
        there = [turning.at(now)]
        near = old.with_moving(there).active(ROBOT.home, None)
        fresh = ObstacleBarrier(ROBOT, law, there, False).active(ROBOT.home, None)
        assert near.indices.tolist() == fresh.indices.tolist()
        counts.add(len(near.indices))
    assert len(counts) > 1


@robots.examples(24)
@given(st.just(ROBOT) | robots.robots(), robots.generators(), st.booleans())
def test_clearance_from_obstacles_stays_above_its_bound(robot, rng, slide):
    try:
        held = held_at(robot.home, str(rng.choice(robot.module_names)), 0.2)
    except GraspError:
        assume(False)
    room = random_room(rng, held, 3, BOUND + 1e-3, wall=bool(rng.integers(2)))
    walker = Driven(held, 0.01, slide_along_limits=slide, obstacles=tuple(room))
    for cycle in range(180):
        if cycle % 60 == 0:
            twist = rng.standard_normal(3) * (0.15, 0.15, 0.4)
        command = walker.step(twist)
        assert clearance(walker.held, room) > BOUND - 1e-4
        if command.scale < 1e-3:
            assert command.limiting


def test_object_comes_to_rest_before_an_obstacle_with_the_names_of_both():
    robot = Driven(HELD, 0.02, slide_along_limits=False, obstacles=(AHEAD,))
    for _ in range(200):
        command = robot.step((0.0, -0.08, 0.0))
    assert command.status is Status.SLOWED_OBSTACLE
    assert 'the object and obstacle post' in command.limiting
    assert clearance(robot.held, [AHEAD]) == pytest.approx(BOUND, abs=2e-3)


def test_object_slides_along_an_obstacle():
    box = Polygon(((-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)))
    x, y, _ = HELD.pose
    table = Obstacle('table', ConvexObject(box, (x, y - 0.3, 0.0)))
    moved = []
    for slide in (False, True):
        robot = Driven(HELD, 0.02, slide_along_limits=slide, obstacles=(table,))
        for _ in range(130):
            command = robot.step((0.03, -0.06, 0.0))
        moved.append(robot.held.pose.x - x)
        assert clearance(robot.held, [table]) > BOUND - 1e-4
    assert command.status is Status.SLIDING
    assert moved[1] > moved[0] + 0.02


@pytest.mark.parametrize('gap', [0.005, -0.02])
def test_start_too_near_an_obstacle_is_left_by_motion_away_only(gap):
    x, y, _ = HELD.pose
    post = Obstacle('post', ConvexObject.disc((x, y - 0.25 - gap), 0.2))
    robot = Driven(HELD, 0.01, slide_along_limits=False, obstacles=(post,))
    for _ in range(30):
        command = robot.step((0.0, -0.05, 0.0))
    assert command.status is Status.SLOWED_OBSTACLE
    assert clearance(robot.held, [post]) > gap - 1e-5
    for _ in range(100):
        command = robot.step((0.0, 0.05, 0.0))
    assert clearance(robot.held, [post]) > gap + 0.02
