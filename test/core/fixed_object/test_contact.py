# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contact of tubes with convex objects: points, complementarity, relaxation, small objects."""

from held_grips import HOME, LOOP, NINE, numbers
from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros import core
from isotruss_ros.core import analyze_grasp, ConvexObject, Disc, Ellipse, load_robot, Polygon
from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.fixed_object.contact import solve_contact
from isotruss_ros.core.fixed_object.contact_points import find_contact_points, Surface
from isotruss_ros.core.kinematics.depths import member_depths, member_lines
from isotruss_ros.core.numerics.tolerances import ROUNDING
from isotruss_ros.core.statics.equilibrium import solve, unloaded
from isotruss_ros.core.statics.structure import structure_of
import numpy as np
import pytest
import robots
from shapes import circle, dense_outline, random_shape, surface_distance
from studies.comparison.wedge import pressed_into


def node_compliance(frame, nodes):
    """Return (c, 2, c, 2): displacements of nodes under unit forces at nodes, solve by solve."""
    rest, answer = unloaded(frame), np.empty((len(nodes), 2, len(nodes), 2))
    for c, node in enumerate(nodes):
        for axis in range(2):
            loads = np.zeros((len(frame.points), 3))
            loads[node, axis] = 1.0
            answer[:, :, c, axis] = solve(rest, loads).displacements[nodes, :2]
    return answer


generators = robots.generators()


@robots.examples(12)
@given(robots.robots(), generators)
def test_compliance_agrees_with_a_frame_with_nodes_at_the_candidates(robot, rng):
    config = robots.random_state(robot, rng)
    center = config.points[rng.integers(len(config.points))] + 0.1 * complex(*rng.normal(size=2))
    points, place, _ = find_contact_points(structure_of(config), circle(center, 0.4), 0.02)
    some = np.sort(rng.permutation(len(points.points))[:8])
    structure = structure_of(config)
    frame = structure.frame.cut(*structure.locate(points.member[some], place[some])[:2])
    expected = node_compliance(frame, frame.layout.nodes)
    count = len(points.points)
    compliance = points.compliance.reshape(2, count, 2, count).transpose(1, 0, 3, 2)
    compliance = compliance[some][:, :, some]
    assert compliance == pytest.approx(expected, rel=1e-6, abs=1e-8 * np.abs(expected).max())


def check_state(contact_points, state, center, radius, share=1e-5):
    """Assert (5) to (8) of a state, by its points alone."""
    moved = contact_points.points + state.displacements
    assert np.abs(np.abs(state.normals) - 1.0).max(initial=0.0) < 1e-12
    assert state.gaps == pytest.approx(np.abs(moved - center) - radius, abs=1e-12)
    assert state.gaps.min(initial=0.0) >= -1e-9
    assert (state.forces >= 0.0).all()
    assert state.gaps[state.forces > 0.0].max(initial=0.0) <= 1e-9
    along = (moved - center) * state.normals.conj()
    assert np.abs(along.imag).max(initial=0.0) < 1e-9
    # The displacements are those of normal forces, and of nothing else.
    push = contact_points.displacements(state.forces * state.normals)
    slack = 1e-8 + share * np.abs(state.displacements).max(initial=0.0)
    assert np.abs(push - state.displacements).max(initial=0.0) <= slack


@pytest.mark.parametrize('diameter', [1e-3, 0.05, 0.4, 9.8])
@pytest.mark.parametrize('preset', robots.PRESETS)
def test_objects_of_any_size_at_any_place_are_solved(preset, diameter):
    robot = load_robot(preset)
    nodes = dict(zip(robot.node_names, robot.home.points, strict=True))
    module = robot.module_names[0]
    b, b_end, c, _ = robots.side_ends(robot.home, module)
    places = {
        'inside a tube': 0.5 * (b + b_end),
        'just beside its axis': 0.47 * (b + b_end) + 0.06 * b + 1e-3j,
        'inside a module': (nodes[robot.topology.joint_names[0]] + b + c) / 3.0,
        'at a joint': nodes[robot.topology.joint_names[0]],
        'in the middle': robot.home.points.mean(),
        'touching nothing': 50.0 + 0j,
    }
    radius = 0.5 * (diameter + robot.description.tube_diameter)
    for center in places.values():
        spacing = max(0.01, 0.01 * diameter)
        points, *_ = find_contact_points(structure_of(robot.home), circle(center, radius), spacing)
        state = solve_contact(points, circle(center, radius))
        check_state(points, state, center, radius, 1e-4)


RADIUS = 0.5 * NINE.description.tube_diameter
NAME = 'south/P-Q'
BOX = Polygon([(-0.03, -0.02), (0.03, -0.02), (0.03, 0.02), (-0.03, 0.02)])
SHAPES = [Disc(0.07), Disc(0.02), Ellipse((0.03, 0.015)), BOX]


def placed(shape, depth, share):
    """Return an object this deep in a member, at a share of its length."""
    start, end = robots.member_ends(HOME, NAME)
    axis = (end - start) / abs(end - start)
    turn, outward = axis * np.exp(0.3j), 1j * axis
    reach = float(shape.support(np.array([outward / turn]))[0])
    center = start + share * (end - start) - outward * (RADIUS + reach - depth)
    return ConvexObject(shape, (center.real, center.imag, np.angle(turn)))


@pytest.mark.parametrize('shape', SHAPES, ids=repr)
@pytest.mark.parametrize('share', [0.1, 0.5, 0.98])
def test_deep_objects_touch_or_are_refused_with_the_member(shape, share):
    for depth in np.linspace(0.2, 0.99, 6) * (RADIUS + shape.reach):
        try:
            pressed = analyze_grasp(HOME, placed(shape, depth, share)).contact_forces
        except SolverError as error:
            pressed = str(error)
        assert NAME in pressed, f'{depth} m'


def test_an_object_deeper_than_a_diameter_of_the_tube_is_refused():
    with pytest.raises(SolverError, match='103 mm deep in it; must be at most 102 mm'):
        analyze_grasp(HOME, placed(Disc(0.3), 0.103, 0.5))


MODULE = 'south/P'
TUBE_RADIUS = 0.5 * HOME.robot.description.tube_diameter
SQUARE_BOX = Polygon([(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)])
SEEDS = st.integers(0, 10**6)


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
    held = pressed_into(HOME, MODULE, SQUARE_BOX, 0.4, 0.02)
    slippery = ConvexObject(held.shape, held.pose, friction=0.1)
    half, tenth = (analyze_grasp(HOME, held, friction).closure_residual for friction in (0.5, 0.1))
    assert analyze_grasp(HOME, held).closure_residual == half < tenth
    assert analyze_grasp(HOME, slippery, 0.5).closure_residual == half
    assert analyze_grasp(HOME, slippery).closure_residual == pytest.approx(tenth)


def test_closure_is_independent_of_the_frame_of_the_object():
    held = pressed_into(HOME, MODULE, SQUARE_BOX, 0.4, 0.02)
    away, wrench = 0.05 - 0.03j, (0.5, -2.0, 0.1)
    shifted = Polygon([(x + away.real, y + away.imag) for x, y in SQUARE_BOX.vertices])
    arm = held.turn * away
    center = held.center - arm
    body = ConvexObject(shifted, (center.real, center.imag, held.pose.angle))
    moment = wrench[2] + (arm.conjugate() * complex(*wrench[:2])).imag
    one = analyze_grasp(HOME, held, 0.1, wrench)
    other = analyze_grasp(HOME, body, 0.1, (*wrench[:2], moment))
    assert one.closure_residual > 1.0
    assert other.closure_residual == pytest.approx(one.closure_residual, rel=1e-6)
    assert other.required_friction == pytest.approx(one.required_friction, rel=1e-6)


def test_a_member_that_the_others_bend_toward_the_object_touches_it():
    body = core.place_between(HOME, LOOP[:2], Disc(0.639), indentation=0.012).body
    assert member_depths(HOME, body)[numbers(LOOP[2:])] < -3e-3
    assert analyze_grasp(HOME, body).contact_forces[LOOP[2]] > 2.0
