# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contact with any convex object: against discs, distances, least squares, and itself."""

from hypothesis import given, strategies
from isotruss_ros.core import analyze_grasp, ConvexObject, load_robot, Polygon
from isotruss_ros.core.fixed_object.contact import solve_contact
from isotruss_ros.core.fixed_object.contact_points import find_contact_points, Surface
from isotruss_ros.core.kinematics.depths import member_lines
from isotruss_ros.core.numerics.tolerances import ROUNDING
from isotruss_ros.core.statics.structure import structure_of
import numpy as np
import pytest
import robots
from shapes import dense_outline, random_shape, surface_distance
from studies.comparison.wedge import pressed_into

HOME = load_robot('nine_member').home
MODULE = 'south/P'
TUBE_RADIUS = 0.5 * HOME.robot.description.tube_diameter
BOX = Polygon([(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)])
SEEDS = strategies.integers(0, 10**6)


@robots.examples(25)
@given(SEEDS)
def test_gaps_and_forces_are_complementary(seed):
    generator = np.random.default_rng(seed)
    shape = random_shape(generator, 0.15)
    held = pressed_into(HOME, MODULE, shape, generator.uniform(-3.0, 3.0), 0.02)
    surface = Surface(held, TUBE_RADIUS)
    points, *_ = find_contact_points(structure_of(HOME), surface, 0.005)
    state = solve_contact(points, surface)
    push = state.forces * state.normals
    assert state.forces.min() >= 0.0
    assert state.forces.sum() > 0.5
    assert state.gaps.min() >= -ROUNDING
    assert np.abs(state.gaps[state.forces > 0.0]).max() <= ROUNDING
    assert state.displacements == pytest.approx(points.displacements(push), abs=1e-8)
    # Against the distances of points from the outline.
    moved = (points.points + state.displacements - held.center) / held.turn
    wanted = surface_distance(dense_outline(held.shape, 4000), moved) - TUBE_RADIUS
    start, end = member_lines(HOME)[points.member].T
    near = np.abs((state.normals / (end - start)).imag * np.abs(end - start)) > 0.3
    assert state.gaps[near] == pytest.approx(wanted[near], abs=2e-6)


def test_friction_defaults_to_that_of_the_object():
    held = pressed_into(HOME, MODULE, BOX, 0.4, 0.02)
    slippery = ConvexObject(held.shape, held.pose, friction=0.1)
    half, tenth = (analyze_grasp(HOME, held, friction).closure_residual for friction in (0.5, 0.1))
    assert analyze_grasp(HOME, held).closure_residual == half < tenth
    assert analyze_grasp(HOME, slippery, 0.5).closure_residual == half
    assert analyze_grasp(HOME, slippery).closure_residual == pytest.approx(tenth)


def test_closure_is_independent_of_the_frame_of_the_object():
    held, away, wrench = pressed_into(HOME, MODULE, BOX, 0.4, 0.02), 0.05 - 0.03j, (0.5, -2.0, 0.1)
    shifted = Polygon([(x + away.real, y + away.imag) for x, y in BOX.vertices])
    arm = held.turn * away
    center = held.center - arm
    body = ConvexObject(shifted, (center.real, center.imag, held.pose.angle))
    moment = wrench[2] + (arm.conjugate() * complex(*wrench[:2])).imag
    one = analyze_grasp(HOME, held, 0.1, wrench)
    other = analyze_grasp(HOME, body, 0.1, (*wrench[:2], moment))
    assert one.closure_residual > 1.0
    assert other.closure_residual == pytest.approx(one.closure_residual, rel=1e-6)
    assert other.required_friction == pytest.approx(one.required_friction, rel=1e-6)
