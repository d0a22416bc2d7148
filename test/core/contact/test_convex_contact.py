# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contact with any convex object: against discs, distances, least squares, and itself."""

from comparison.wedge import pressed_into
from hypothesis import example, given, strategies
from isotruss_ros.core import (
    analyze_grasp,
    ConvexObject,
    Ellipse,
    load_robot,
    Polygon,
    tangent_center,
)
from isotruss_ros.core.contact.contact import solve_contact
from isotruss_ros.core.contact.contact_points import find_contact_points
from isotruss_ros.core.contact.flattening import flattening_of
from isotruss_ros.core.contact.sliding_contact import solve_sliding_contact
from isotruss_ros.core.contact.surfaces import surface_of
from isotruss_ros.core.errors import GraspError, SolverError
from isotruss_ros.core.numerics.tolerances import ROUNDING
from isotruss_ros.core.statics.structure import structure_of
import numpy as np
import pytest
from random_grips import scaled
import robots
from shapes import dense_outline, random_shape, random_shape_of, surface_distance

HOME = load_robot('nine_member').home
MODULE = 'south/P'
TUBE_RADIUS = 0.5 * HOME.robot.description.tube_diameter
BOX = Polygon([(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)])
SEEDS = strategies.integers(0, 10**6)
DISC = ConvexObject.disc(tangent_center(HOME, MODULE, 0.3, 0.03), 0.3)


def held_alike(shape, angle=0.0):
    """Return an object where the disc is."""
    return ConvexObject(shape, (*DISC.pose[:2], angle))


@pytest.mark.parametrize('shape', [BOX, Ellipse((0.15, 0.1))])
def test_relaxation_refuses_flattening_tubes(shape):
    with pytest.raises(GraspError, match='supports discs only'):
        analyze_grasp(HOME, held_alike(shape), method='relaxation')


# Gaps and forces


@robots.examples(25)
@given(SEEDS, strategies.booleans())
def test_gaps_and_forces_are_complementary(seed, flattening):
    generator = np.random.default_rng(seed)
    shape = random_shape(generator, 0.15)
    held = pressed_into(HOME, MODULE, shape, generator.uniform(-3.0, 3.0), 0.02)
    spacing = 0.005
    surface = surface_of(held, 0.0 if flattening else TUBE_RADIUS)
    structure = structure_of(HOME)
    kernel = flattening_of(HOME.robot, structure.pressures) if flattening else None
    points = find_contact_points(structure, surface, spacing, kernel)
    seen = surface.resolved(spacing) if flattening else surface
    solve = solve_sliding_contact if flattening else solve_contact
    state = solve(points, seen)
    assert state.forces.min() >= 0.0
    assert state.forces.sum() > 0.5
    assert state.gaps.min() >= -ROUNDING
    assert np.abs(state.gaps[state.forces > 0.0]).max() <= ROUNDING
    assert state.displacements == pytest.approx(points.displacements(state.push), abs=1e-9)
    # By brute force, of the shape that the points met.
    moved = (points.skin + state.displacements - held.center) / held.turn
    outline = dense_outline(seen.shape, 4000)
    wanted = surface_distance(outline, moved) - (0.0 if flattening else TUBE_RADIUS)
    near = np.abs(state.normals * points.axis.conj()).imag > 0.3
    assert state.gaps[near] == pytest.approx(wanted[near], abs=2e-6)
    if not flattening:
        turned = state.push[state.forces > 0.0] / state.normals[state.forces > 0.0]
        assert turned.imag == pytest.approx(0.0, abs=1e-5)


# Corners and faces


def largest_difference(analysis, other):
    """Return by how much two wrenches of normal forces differ, against the force."""
    apart = (analysis.normal_wrench - other.normal_wrench) / [1.0, 1.0, 0.15]
    return np.abs(apart).max() / np.abs(other.normal_wrench).max()


@pytest.mark.parametrize('angle', [-2.2, 0.4, 1.8])
def test_wrench_at_a_sharp_corner_is_independent_of_point_positions(angle):
    held = pressed_into(HOME, MODULE, BOX, angle, 0.02)
    fine, *others = (
        analyze_grasp(HOME, held, spacing=spacing) for spacing in (0.002, 0.0035, 0.005, 0.007)
    )
    for one in others:
        assert largest_difference(one, fine) < 0.01


def test_friction_defaults_to_that_of_the_object():
    held = pressed_into(HOME, MODULE, BOX, 0.4, 0.02)
    slippery = ConvexObject(held.shape, held.pose, friction=0.1)
    half, tenth = (analyze_grasp(HOME, held, friction).closure_margin for friction in (0.5, 0.1))
    assert analyze_grasp(HOME, held).closure_margin == half
    assert analyze_grasp(HOME, slippery, 0.5).closure_margin == half
    assert analyze_grasp(HOME, slippery).closure_margin == pytest.approx(tenth)
    assert tenth < half


def press_polygon(seed, share=1.0):
    """Return a polygon of random size that is pressed in by a share of its depth."""
    generator = np.random.default_rng(seed)
    shape = scaled(random_shape_of(Polygon, generator), generator.uniform(0.1, 1.5))
    module = HOME.robot.module_names[generator.integers(9)]
    depth, angle = generator.uniform(0.005, 0.08), generator.uniform(-3.0, 3.0)
    return pressed_into(HOME, module, shape, angle, share * depth)


# Full steps alone cycle between two to four sets of points.
@pytest.mark.parametrize('seed', [117, 538, 1223, 1367, 1684, 1961])
def test_contacts_converge_by_damping_if_full_steps_cycle(seed):
    analysis = analyze_grasp(HOME, press_polygon(seed))
    assert sum(analysis.contact_forces.values()) > 0.0


@robots.examples(30)
@given(SEEDS)
@example(99533)
def test_contacts_of_polygons_wider_than_the_tube_converge_unless_a_tube_wrinkles(seed):
    held = press_polygon(seed)
    if held.arm <= TUBE_RADIUS:
        return
    try:
        analysis = analyze_grasp(HOME, held)
    except SolverError as error:
        refused = str(error)
    else:
        assert analysis.gaps.min() >= -ROUNDING
        return
    if 'where contact is not modelled' not in refused:
        assert 'the structure becomes unstable' in refused
        wrinkled = analyze_grasp(HOME, press_polygon(seed, 0.7)).utilisation
        assert max(wrinkled.values()) > 1.0


@pytest.mark.parametrize('seed', [25, 89, 151, 215])
def test_deep_indentation_at_once_and_in_small_steps_agree(seed):
    at_once, in_steps = analyze_grasp(HOME, press_polygon(seed)), None
    for share in np.linspace(0.3, 1.0, 20):
        in_steps = analyze_grasp(HOME, press_polygon(seed, share), previous=in_steps)
    assert at_once.contact_forces == pytest.approx(in_steps.contact_forces, rel=5e-3)


@pytest.mark.parametrize('angle', [-3.0, -1.0, 0.0, 1.0])
def test_contact_is_at_most_half_the_circumference_wide(angle):
    held = pressed_into(HOME, MODULE, BOX, angle, 0.05)
    analysis = analyze_grasp(HOME, held, pressure=15e3)
    widest = np.pi * TUBE_RADIUS
    assert analysis.flattened
    for name, width in analysis.contact_widths.items():
        assert width == pytest.approx(widest) if name in analysis.flattened else width < widest
        # Pressure and area still bear the force.
        force = analysis.contact_pressures[name] * analysis.contact_areas[name]
        assert force == pytest.approx(analysis.contact_forces[name])
        assert analysis.contact_areas[name] <= 1.001 * widest * analysis.contact_lengths[name]
