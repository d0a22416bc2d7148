# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fixed objects: contacts with tubes, analysis, refusals, and closure against linear programs."""

import itertools
import math

from grips import pressed_between, random_pressed
from held_grips import HOME, LOOP, NINE, numbers
from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros import core
from isotruss_ros.core.errors import GraspError, SolverError
from isotruss_ros.core.fixed_object.contact import (
    advance_forces,
    RelaxationGains,
    solve_contact,
)
from isotruss_ros.core.fixed_object.contact_points import find_contact_points, Surface
from isotruss_ros.core.fixed_object.friction_closure import balance_by_friction
from isotruss_ros.core.kinematics.depths import member_depths, member_lines
from isotruss_ros.core.model.presets import preset_names
from isotruss_ros.core.numerics.tolerances import ROUNDING
from isotruss_ros.core.statics.structure import structure_of
from isotruss_ros.core.statics.tangent import solve, unloaded
from nightly import some_now
import numpy as np
import pytest
import robots
from scipy.optimize import linprog
from shapes import circle, dense_outline, random_shape, surface_distance
from wedge import pressed_into

generators = robots.generators()


@pytest.fixture(scope='module')
def gripped():
    """Return a grasp of the nine-member robot whose two sides press by 10 mm."""
    return pressed_between(core.load_robot('nine_member'), 'north/Z', 0.5, 0.01)


@robots.examples(40)
@given(generators, st.floats(0.0, 1.5))
def test_wrench_forces_and_regions_are_consistent(rng, friction):
    config, cylinder = random_pressed(rng)
    size = 20.0 * 10.0 ** rng.uniform(-2.0, 0.0)
    external = rng.normal(size=3) * [size, size, size * cylinder.shape.diameter]
    analysis = core.analyze_grasp(config, cylinder, friction, external)
    forces, normals = analysis.normal_forces, analysis.normals
    assert forces.min() >= 0.0
    assert analysis.gaps.min() >= -1e-9
    assert (analysis.gaps * forces).max() <= 1e-9 * forces.max()
    # The tube pushes the object against the outward normals; all of them through its centre.
    arms = 0.5 * cylinder.shape.diameter * normals
    wrench = np.append(-forces @ normals, -np.cross(arms, forces[:, None] * normals).sum())
    assert analysis.normal_wrench == pytest.approx(wrench, abs=1e-9 * forces.sum())
    assert (np.abs(analysis.friction_forces) <= friction * forces * (1.0 + 1e-12)).all()
    # What is left when friction has acted at the object's surface is the residual.
    rubbing = analysis.friction_forces[:, None] * np.column_stack([-normals[:, 1], normals[:, 0]])
    total = wrench + external
    total += np.append(rubbing.sum(axis=0), np.cross(arms, rubbing).sum())
    total[2] /= 0.5 * cylinder.shape.diameter
    left = np.linalg.norm(total)
    slack = 1e-9 * (forces.sum() + np.abs(external).max())
    assert analysis.closure_residual == pytest.approx(left, abs=slack)
    assert analysis.closed_by_friction == (analysis.closure_residual <= analysis.closure_tolerance)


@robots.examples(20)
@given(generators)
def test_utilisation_agrees_with_the_linear_deformation_under_the_contact_forces(rng):
    config, cylinder = random_pressed(rng)
    analysis = core.analyze_grasp(config, cylinder, spacing=0.02)
    names, loads = config.robot.member_names, {}
    for k in np.flatnonzero(analysis.normal_forces > 0.0):
        x, y = analysis.normal_forces[k] * analysis.normals[k]
        loads.setdefault(names[analysis.members[k]], []).append((analysis.places[k], x, y, 0.0))
    expected = core.deform(config, {}, tube_loads=loads, paper_model=True).utilisation
    assert analysis.utilisation == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_nothing_is_closed_without_contact():
    config = core.load_robot('nine_member').home
    far = core.ConvexObject.disc((0.5, 30.0), 0.2)
    # Nothing has to be balanced, but nothing is held.
    assert not core.analyze_grasp(config, far).closed_by_friction
    for method in ('exact', 'relaxation'):
        pulled = core.analyze_grasp(config, far, external_wrench=(0, -1, 0), method=method)
        assert not pulled.closed_by_friction
        assert pulled.required_friction == math.inf
        assert pulled.closure_residual == pytest.approx(1.0)


def test_exact_and_relaxed_contact_agree(gripped):
    config, cylinder = gripped
    exact = core.analyze_grasp(config, cylinder, external_wrench=(0, -2, 0))
    relaxed = core.analyze_grasp(config, cylinder, external_wrench=(0, -2, 0), method='relaxation')
    size = exact.normal_forces.sum()
    assert relaxed.normal_forces == pytest.approx(exact.normal_forces, abs=1e-3 * size)
    assert relaxed.normal_forces.sum() == pytest.approx(size, rel=1e-4)
    assert relaxed.gaps == pytest.approx(exact.gaps, abs=2e-6)
    # The coefficient is infinite or very large, where two members press differently.
    required = (1.0 / analysis.required_friction for analysis in (relaxed, exact))
    assert next(required) == pytest.approx(next(required), abs=1e-4)


@pytest.mark.parametrize('name', some_now(preset_names(), 2))
def test_relaxation_converges_with_its_default_gains(name):
    robot = core.load_robot(name)
    for module, depth in ((robot.module_names[0], 0.002), (robot.module_names[-1], 0.01)):
        center = core.tangent_center(robot.home, module, 0.25, depth)
        body = core.ConvexObject.disc(center, 0.25)
        exact, relaxed = (
            core.analyze_grasp(robot.home, body, method=method)
            for method in ('exact', 'relaxation')
        )
        assert relaxed.contact_forces == pytest.approx(exact.contact_forces, rel=1e-3)


def test_a_step_of_the_relaxation_is_equation_9():
    # One point with 1 N, 3 mm off the object; with 1 N and 0.5 N along, 2 mm inside.
    gains = RelaxationGains(100.0, 0.5, 1.0)
    off = advance_forces(np.array([1.0 + 0j]), np.array([3e-3]), np.array([1.0 + 0j]), gains)
    assert off == pytest.approx([0.997])
    inside = advance_forces(np.array([0.5 + 1j]), np.array([-2e-3]), np.array([1j]), gains)
    assert inside == pytest.approx([0.25 + 1.2j])


def test_relaxation_that_does_not_converge_is_refused_with_its_gains(gripped):
    config, cylinder = gripped
    with pytest.raises(
        SolverError, match=r'\(9\) did not converge .* K1 = 1e\+06 N/m, K2 = 1, K3 = 2'
    ):
        core.analyze_grasp(config, cylinder, method='relaxation', gains=(1e6, 1.0, 2.0))
    with pytest.raises(GraspError, match='must not be negative'):
        core.analyze_grasp(config, cylinder, method='relaxation', gains=(-1.0, 1.0, 2.0))


def test_contact_lengths_include_half_a_spacing_beyond_the_outermost_points(gripped):
    config, cylinder = gripped
    analysis = core.analyze_grasp(config, cylinder, spacing=0.005)
    assert len(analysis.contact_lengths) == 2
    for name, length in analysis.contact_lengths.items():
        on_member = analysis.members == config.robot.member_names.index(name)
        forces, places = analysis.normal_forces[on_member], analysis.places[on_member]
        assert length == pytest.approx(np.ptp(places[forces > 0.0]) + 0.005)
        assert forces[0] == forces[-1] == 0.0  # candidates beyond the contact


@pytest.mark.parametrize('pressures', [[30e3, 25e3, 20e3], {'east': 25e3, 'south': 30e3}])
def test_measured_pressures_agree_with_a_robot_file_of_these_pressures(gripped, pressures):
    config, cylinder = gripped
    document = robots.preset_document('nine_member')
    north = 20e3 if isinstance(pressures, list) else config.robot.description.pressures['north']
    document['tube']['pressure'] = {'south': 30e3, 'east': 25e3, 'north': north}
    expected = core.analyze_grasp(robots.load(document).home, cylinder)
    measured = core.analyze_grasp(config, cylinder, pressure=pressures)
    np.testing.assert_array_equal(measured.normal_forces, expected.normal_forces)


@pytest.mark.parametrize('degrees', [26.0, 60.0])
def test_required_friction_of_a_wedge_is_the_tangent_of_half_its_angle(degrees):
    half = np.radians(0.5 * degrees)
    document = robots.example()
    document['joints'] = {
        'P': [-1.5 * np.sin(half), -1.5 * np.cos(half)],
        'Q': [1.5 * np.sin(half), -1.5 * np.cos(half)],
        'X': [0.0, 0.0],
    }
    # Supports that mirror: the object is pressed down, along the middle.
    document['supports'] = {'X': ['x'], 'P': ['y'], 'Q': ['y']}
    document['tube']['diameter'] = 0.05
    document['module'].update(pinch_separation=0.06, rod_length=0.05)
    robot = robots.load(document)
    b, b_end, c, c_end = robots.side_ends(robot.home, 'south/X')
    opening = abs(np.angle((b_end - b) / (c_end - c)))
    # The sides run from pinch point to pinch point, nearly from joint to joint.
    assert np.degrees(opening) == pytest.approx(degrees, abs=6.0)
    config, cylinder = pressed_between(robot, 'south/X', 0.5, 1e-5)
    analysis = core.analyze_grasp(config, cylinder, friction=1.0)
    # Both sides press alike, downward.
    forces = analysis.normal_forces
    assert analysis.normal_wrench[0] == pytest.approx(0.0, abs=1e-6 * forces.sum())
    assert analysis.normal_wrench[1] < 0.0
    assert analysis.closed_by_friction
    assert analysis.required_friction == pytest.approx(np.tan(0.5 * opening), rel=1e-4)


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        ({'friction': math.nan}, 'friction'),
        ({'friction': -0.1}, 'must be from 0 to 10'),
        ({'spacing': 9.9e-5}, 'spacing'),
        ({'method': 'guess'}, 'exact, relaxation'),
        ({'external_wrench': (0.0, math.inf, 0.0)}, 'wrench'),
    ],
)
def test_invalid_arguments_are_refused(gripped, options, message):
    config, cylinder = gripped
    with pytest.raises(GraspError, match=message):
        core.analyze_grasp(config, cylinder, **options)


coefficients = st.floats(0.0, 1.5)


def tangents_at(angles):
    """Return the counter-clockwise tangents of a disc at these angles of its surface."""
    return np.column_stack([-np.sin(angles), np.cos(angles)])


def random_contacts(rng, count):
    """Return tangents, normal forces (some of them zero) and a load of about their size."""
    tangents = tangents_at(rng.uniform(0.0, 2.0 * np.pi, count))
    forces = rng.uniform(0.1, 10.0, count) * (rng.random(count) < 0.8)
    load = wrenches(tangents, forces).T @ rng.uniform(-1.0, 1.0, count)
    return tangents, forces, load


def wrenches(tangents, forces, levers=1.0):
    """Return (k, 3): of friction N_i at each contact, moments over the arm."""
    return forces[:, None] * np.column_stack([tangents, np.full(len(forces), levers)])


def least_friction(tangents, forces, load, levers=1.0):
    """Return the smallest coefficient by a linear program; infinite if there is none."""
    k, size = len(forces), max(forces.max(initial=0.0), 1e-9)
    one = np.ones((k, 1))
    answer = linprog(
        np.append(np.zeros(k), 1.0),
        A_ub=np.block([[np.eye(k), -one], [-np.eye(k), -one]]),
        b_ub=np.zeros(2 * k),
        A_eq=np.column_stack([wrenches(tangents, forces, levers).T, np.zeros(3)]) / size,
        b_eq=-load / size,
        bounds=[(None, None)] * k + [(0.0, None)],
        method='highs',
    )
    return answer.x[-1] if answer.status == 0 else np.inf


def reach_along(tangents, forces, load, friction, direction, levers=1.0):
    """Return the largest extra load of this direction that friction balances, by a program."""
    k, size = len(forces), forces.max()
    answer = linprog(
        np.append(np.zeros(k), -1.0),
        A_eq=np.column_stack([wrenches(tangents, forces, levers).T / size, direction]),
        b_eq=-load / size,
        bounds=[(-friction, friction)] * k + [(None, None)],
        method='highs',
    )
    return answer.x[-1] * size


@robots.examples(60)
@given(generators, st.integers(3, 15), st.floats(0.05, 1.5))
def test_closure_margin_is_the_minimum_over_all_directions(rng, count, friction):
    tangents, forces, _ = random_contacts(rng, count)
    forces += 0.1
    shares = rng.uniform(-friction, friction, count)
    arms = rng.uniform(0.3, 1.5, count)
    load = -wrenches(tangents, forces, arms).T @ shares
    margin = balance_by_friction(tangents, forces, load, friction, arms).margin
    assert margin >= -1e-9
    directions = rng.normal(size=(40, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    reached = [reach_along(tangents, forces, load, friction, way, arms) for way in directions]
    assert min(reached) >= margin * (1.0 - 1e-6) - 1e-6
    # The shortest way is across a facet, a plane of two contacts: one of those reaches no further.
    pairs = itertools.combinations(wrenches(tangents, np.ones(count), arms), 2)
    facets = np.array([np.cross(*pair) for pair in pairs])
    facets = facets[np.linalg.norm(facets, axis=1) > 1e-6]
    facets /= np.linalg.norm(facets, axis=1)[:, None]
    spans = np.abs(facets @ wrenches(tangents, forces, arms).T).sum(axis=1)
    nearest = facets[(friction * spans - np.abs(facets @ load)).argmin()]
    ways = (nearest, -nearest)
    reached = [reach_along(tangents, forces, load, friction, way, arms) for way in ways]
    assert min(reached) == pytest.approx(margin, rel=1e-5, abs=1e-6)


# Objects that are no discs: friction has levers of its own.


@robots.examples(80)
@given(generators, st.integers(1, 15), coefficients, st.sampled_from([1e-6, 1.0, 1e6]))
def test_required_friction_with_levers_agrees_with_a_linear_program(rng, count, friction, scale):
    tangents, forces, _ = random_contacts(rng, count)
    levers = rng.uniform(-0.5, 2.0, count)
    load = wrenches(tangents, forces, levers).T @ rng.uniform(-1.0, 1.0, count)
    expected = least_friction(tangents, forces, load, levers)
    forces, load = scale * forces, scale * load
    closure = balance_by_friction(tangents, forces, load, friction, levers)
    assert closure.required_friction == pytest.approx(expected, rel=1e-5, abs=1e-6)
    left = load + np.column_stack([tangents, levers]).T @ closure.friction_forces
    assert closure.residual == pytest.approx(np.linalg.norm(left), abs=1e-9 * forces.sum())
    assert closure.closed == (closure.residual <= closure.tolerance)
    if closure.required_friction <= friction:
        assert closure.closed
    else:
        # What is closed although it needs a little more friction is so within the tolerance.
        assert closure.margin <= 0.0
        assert closure.residual >= -closure.margin * (1.0 - 1e-9) - 1e-12 * forces.sum()


@pytest.mark.parametrize(('apart', 'closed'), [(1e-7, True), (1e-5, False)])
def test_opposite_contacts_have_closure_up_to_a_relative_tolerance_of_1e_6(apart, closed):
    tangents, forces = tangents_at(np.array([0.0, np.pi])), np.array([10.0, 10.0 * (1.0 + apart)])
    load = np.array([forces[1] - forces[0], 0.0, 0.0])
    closure = balance_by_friction(tangents, forces, load, 0.5, np.ones(2))
    assert closure.residual == pytest.approx(10.0 * apart, rel=1e-3)
    assert closure.closed is closed
    # No wrench across the plane of both contacts is balanced.
    assert closure.margin <= 0.0


def node_compliance(frame, nodes):
    """Return (c, 2, c, 2): displacements of nodes under unit forces at nodes, solve by solve."""
    rest, answer = unloaded(frame), np.empty((len(nodes), 2, len(nodes), 2))
    for c, node in enumerate(nodes):
        for axis in range(2):
            loads = np.zeros((len(frame.points), 3))
            loads[node, axis] = 1.0
            answer[:, :, c, axis] = solve(rest, loads).displacements[nodes, :2]
    return answer


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
    robot = core.load_robot(preset)
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
BOX = core.Polygon([(-0.03, -0.02), (0.03, -0.02), (0.03, 0.02), (-0.03, 0.02)])
SHAPES = [core.Disc(0.07), core.Disc(0.02), core.Ellipse((0.03, 0.015)), BOX]


def placed(shape, depth, share):
    """Return an object this deep in a member, at a share of its length."""
    start, end = robots.member_ends(HOME, NAME)
    axis = (end - start) / abs(end - start)
    turn, outward = axis * np.exp(0.3j), 1j * axis
    reach = float(shape.support(np.array([outward / turn]))[0])
    center = start + share * (end - start) - outward * (RADIUS + reach - depth)
    return core.ConvexObject(shape, (center.real, center.imag, np.angle(turn)))


@pytest.mark.parametrize('shape', SHAPES, ids=repr)
@pytest.mark.parametrize('share', [0.1, 0.5, 0.98])
def test_deep_objects_touch_or_are_refused_with_the_member(shape, share):
    for depth in np.linspace(0.2, 0.99, 6) * (RADIUS + shape.reach):
        try:
            pressed = core.analyze_grasp(HOME, placed(shape, depth, share)).contact_forces
        except SolverError as error:
            pressed = str(error)
        assert NAME in pressed, f'{depth} m'


def test_an_object_deeper_than_a_diameter_of_the_tube_is_refused():
    with pytest.raises(SolverError, match='103 mm deep in it; must be at most 102 mm'):
        core.analyze_grasp(HOME, placed(core.Disc(0.3), 0.103, 0.5))


MODULE = 'south/P'
TUBE_RADIUS = 0.5 * HOME.robot.description.tube_diameter
SQUARE_BOX = core.Polygon([(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)])
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
    slippery = core.ConvexObject(held.shape, held.pose, friction=0.1)
    half, tenth = (
        core.analyze_grasp(HOME, held, friction).closure_residual for friction in (0.5, 0.1)
    )
    assert core.analyze_grasp(HOME, held).closure_residual == half < tenth
    assert core.analyze_grasp(HOME, slippery, 0.5).closure_residual == half
    assert core.analyze_grasp(HOME, slippery).closure_residual == pytest.approx(tenth)


def test_closure_is_independent_of_the_frame_of_the_object():
    held = pressed_into(HOME, MODULE, SQUARE_BOX, 0.4, 0.02)
    away, wrench = 0.05 - 0.03j, (0.5, -2.0, 0.1)
    shifted = core.Polygon([(x + away.real, y + away.imag) for x, y in SQUARE_BOX.vertices])
    arm = held.turn * away
    center = held.center - arm
    body = core.ConvexObject(shifted, (center.real, center.imag, held.pose.angle))
    moment = wrench[2] + (arm.conjugate() * complex(*wrench[:2])).imag
    one = core.analyze_grasp(HOME, held, 0.1, wrench)
    other = core.analyze_grasp(HOME, body, 0.1, (*wrench[:2], moment))
    assert one.closure_residual > 1.0
    assert other.closure_residual == pytest.approx(one.closure_residual, rel=1e-6)
    assert other.required_friction == pytest.approx(one.required_friction, rel=1e-6)


def test_a_member_that_the_others_bend_toward_the_object_touches_it():
    body = core.place_between(HOME, LOOP[:2], core.Disc(0.639), indentation=0.012).body
    assert member_depths(HOME, body)[numbers(LOOP[2:])] < -3e-3
    assert core.analyze_grasp(HOME, body).contact_forces[LOOP[2]] > 2.0
