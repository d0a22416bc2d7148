# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contact: flattening and dents of the skin, and grasp quality of Ferrari and Canny."""

from dataclasses import replace
import math

from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros import core
from isotruss_ros.core import Disc, Ellipse, load_robot, Polygon, Robot
from isotruss_ros.core.contact.dents import ANGLE_STEP, dent_table, Dents, DentTable, find_table
from isotruss_ros.core.contact.pressed_skin import (
    CHORD_POINTS,
    Flattening,
    flattening_of,
    press_skin,
    solve_convex_contacts,
)
from isotruss_ros.core.contact.wrench_space import wrench_space
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.fixed_object.contact import solve_contact
from isotruss_ros.core.fixed_object.contact_points import ContactPoints
from isotruss_ros.core.model.scaled_shape import ScaledShape
from isotruss_ros.core.numerics.qp import solve_complementarity
from isotruss_ros.core.numerics.work_limit import limited_work, WorkLimitError
from isotruss_ros.core.statics.tube_stiffness import Fabric
from isotruss_ros.dataset.random_grasps import draw_shape
import numpy as np
import pytest
import robots
from scipy.optimize import linprog
from shapes import circle

ROBOT = load_robot('nine_member')
KERNEL = flattening_of(ROBOT, 34.5e3)
SQUARE = Polygon([(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)])


def disc_table(radius):
    return dent_table(KERNEL, Disc(2.0 * radius))


def dent(table, force, angle):
    """Return the depth of a dent, and its derivatives by the force and by the angle."""
    return [values.item() for values in Dents([table])(np.array([force]), np.array([angle]))]


@pytest.mark.parametrize('radius', [0.03, 0.15])
def test_dent_of_a_rigid_tube_agrees_with_the_table(radius):
    tube = 0.5 * ROBOT.description.tube_diameter
    table = disc_table(radius)
    places, alike = 1e-3 * np.arange(-150, 151), np.zeros(301, dtype=int)
    compliance = np.zeros((602, 602))
    compliance[301:, 301:] = KERNEL.compliance(np.arange(301), 1e-3)
    for depth in (0.002, 0.01, 0.02):
        surface = circle(1j * (tube + radius - depth), radius)
        normals = surface.nearest(places).normals
        across = compliance + 1e-12 * np.eye(602)
        contact = solve_contact(ContactPoints(places + 1j * tube, normals, alike, across), surface)
        push = (contact.forces * contact.normals).sum()
        assert abs(push.real) < 1e-6 * abs(push)
        assert dent(table, -push.imag, 0.0)[0] == pytest.approx(depth, rel=0.02)


def test_a_long_face_dents_as_an_elastic_foundation():
    # Half of a face of 0.3 m, on a foundation of 4 pi p / 3.
    table, stiffness = dent_table(KERNEL, SQUARE, 2), 0.15 * 4.0 * np.pi * 34.5e3 / 3.0
    assert dent(table, 5.0, 0.5 * np.pi)[0] == pytest.approx(5.0 / stiffness, rel=0.02)
    assert dent(table, 15.0, 0.5 * np.pi)[0] < 0.2 * dent(table, 15.0, 0.25 * np.pi)[0]


@pytest.mark.parametrize('angle', [1.5e-4, 0.02, 0.6, 1.5])
def test_dents_of_mirrored_corners_are_equal(angle):
    right, left = (dent_table(KERNEL, SQUARE, corner) for corner in (2, 3))
    depth, mirrored = dent(right, 20.0, angle)[0], dent(left, 20.0, np.pi - angle)[0]
    assert mirrored == pytest.approx(depth, rel=1e-9)


def test_skin_that_is_pressed_deeper_than_the_table_carries_the_force():
    skins = Dents([disc_table(0.03)]).press(np.array([1e5]), np.zeros(1))
    assert skins.forces.sum() == pytest.approx(1e5)


def random_contacts(count, seed=0):
    """Return compliance columns and gaps of all depths of corners and ellipses in tubes."""
    rng, columns, gaps = np.random.default_rng(seed), [], []
    for _ in range(count):
        kernel = flattening_of(ROBOT, float(rng.choice([5e3, 34.5e3, 2e5])))
        shape = draw_shape(rng, str(rng.choice(['polygon', 'ellipse'])), (0.05, 0.5))
        if rng.random() < 0.5 and isinstance(shape, Polygon):
            shape = Polygon(shape.vertices, float(rng.uniform(0.0, 0.005)))
        table = DentTable(kernel, shape)
        middle, half_turn, last = table.angles
        # Also at both faces, where a dent is long.
        at = float(rng.choice([-1.0, 1.0, rng.uniform(-1.0, 1.0)]))
        angle = middle + at * (half_turn if last else math.pi)
        positions, heights = table.chords(angle, table.depths[1:])
        spacing = positions[:, 1] - positions[:, 0]
        columns.append(kernel.compliance_column(positions.shape[1], spacing))
        gaps.append(heights - table.depths[1:, None])
    return np.concatenate(columns), np.concatenate(gaps)


@pytest.mark.parametrize('count', [300, pytest.param(10_000, marks=pytest.mark.nightly)])
def test_block_pivoting_solves_each_of_many_random_corners(count):
    columns, gaps = random_contacts(count)
    solved = [solve_convex_contacts(columns[i::64], gaps[i::64])[1] for i in range(64)]
    assert np.concatenate(solved).all()


def test_block_pivoting_agrees_with_nonnegative_least_squares():
    columns, gaps = random_contacts(100, seed=1)
    forces, _ = solve_convex_contacts(columns, gaps)
    distances = np.abs(np.arange(gaps.shape[1])[:, None] - np.arange(gaps.shape[1]))
    for column, gap, force in zip(columns, gaps, forces, strict=True):
        expected, _ = solve_complementarity(column[distances], gap)
        assert force == pytest.approx(expected, rel=1e-12, abs=1e-12 * expected.max())


def test_skin_with_a_hole_in_its_contact_is_solved_by_the_fallback():
    # An object that is not convex presses at both ends of the chord.
    positions = np.linspace(-0.1, 0.1, CHORD_POINTS)[None]
    heights, depth = 0.02 * np.cos(15.0 * np.pi * positions) + 0.02, np.array([0.03])
    skin = press_skin(KERNEL, positions, heights, depth)
    compliance = KERNEL.compliance(np.arange(CHORD_POINTS), skin.spacing[0])
    gaps = heights[0] - depth + compliance @ skin.forces[0]
    assert skin.forces.min() >= 0.0
    assert gaps.min() >= -1e-12
    assert np.abs(gaps * skin.forces[0]).max() < 1e-12


@pytest.mark.parametrize('force', [10.0, 30.0])
def test_a_circular_ellipse_dents_as_a_disc(force):
    tables = disc_table(0.15), dent_table(KERNEL, Ellipse((0.15, 0.15)))
    disc, ellipse = (dent(table, force, 0.7)[0] for table in tables)
    assert ellipse == pytest.approx(disc, rel=0.02)


#: Angles of normals: of a smooth shape, and of a corner, also near both of its faces.
TURNS = [(Disc(0.3), 0.0), *((Ellipse((0.2, 0.1)), x) for x in (0.0, 0.3, 1.57, -3.1))]
TURNS += [(Polygon([(0, 0), (0.3, 0), (0, 0.3)]), x) for x in (-2.4, -3.0, -3.1, -1.65, -1.58)]


@pytest.mark.parametrize('force', [0.3, 40.0, 1e3, -5.0])
@pytest.mark.parametrize(('shape', 'angle'), TURNS)
def test_derivatives_by_force_and_angle_agree_with_finite_differences(shape, angle, force):
    table = dent_table(KERNEL, shape)
    depth, *derivatives = dent(table, force, angle)
    for step, derivative in zip(1e-6 * np.diag([force, 1.0]), derivatives, strict=True):
        ahead, behind = (
            dent(table, force + way * step[0], angle + way * step[1])[0] for way in (1, -1)
        )
        slope = (ahead - behind) / (2.0 * step.sum())
        assert derivative == pytest.approx(slope, rel=1e-4, abs=1e-6 * abs(depth))
    assert dent(table, -force, angle)[0] == -depth
    # Angles of a rolling object are continued beyond half a turn.
    assert dent(table, force, angle + 2.0 * np.pi)[0] == pytest.approx(depth, rel=1e-9)


@pytest.mark.parametrize('force', [0.3, 40.0, -5.0])
@pytest.mark.parametrize('shape', [Disc(0.3), Ellipse((0.2, 0.1))])
def test_pressure_derivative_agrees_with_finite_differences(shape, force):
    def table(pressure):
        return dent_table(flattening_of(ROBOT, pressure), shape)

    # So short that the same points are closed on both sides.
    pressure, step = 34e3, 5.0
    wide, narrow = (dent(table(pressure + way), force, 1.57)[0] for way in (step, -step))
    slope = (wide - narrow) / (2.0 * step)
    (rate,) = Dents([table(pressure)]).pressure_rates(np.array([force]), np.array([1.57]))
    assert rate == pytest.approx(slope, rel=1e-5)
    assert slope * force < 0.0


@pytest.mark.parametrize('change', [-ANGLE_STEP, ANGLE_STEP])
def test_dents_sampled_ahead_need_no_work_at_the_next_angle(change):
    dents = Dents([DentTable(KERNEL, Ellipse((0.2, 0.1)))])
    force, angle = np.array([40.0]), np.array([0.7])
    dents(force, angle)
    with limited_work(0), pytest.raises(WorkLimitError):
        dents(force, angle + change)
    for _ in range(2):  # one sample each
        dents.sample_ahead(angle)
    with limited_work(0):
        dents(force, angle + change)


RADIUS, PRESSURE = 0.051, 34.5e3
FABRIC = Fabric(6e4, 1e4)


def kernel(count, spacing, fabric=FABRIC, **options):
    """Return the compliance of points on a line."""
    return Flattening(RADIUS, PRESSURE, fabric, **options).compliance(np.arange(count), spacing)


@pytest.mark.parametrize('fabric', [FABRIC, None])
@pytest.mark.parametrize(
    ('modes', 'spacing'), [(2, 0.005), (100, 0.005), (8, 0.001), (8, 0.0025), (8, 0.1)]
)
def test_uniform_one_sided_load_has_the_stiffness_of_four_thirds_pi_p(fabric, modes, spacing):
    # Sum over n >= 2 of 1 / (pi p (n^2 - 1)) is 3 / (4 pi p).
    half = int(0.8 / spacing) + 1
    matrix = kernel(2 * half + 1, spacing, fabric=fabric, modes=modes)
    dent = matrix[half].sum() * spacing  # of one newton per metre
    assert 1.0 / dent == pytest.approx(4.0 / 3.0 * np.pi * PRESSURE, rel=1e-6)


@pytest.mark.parametrize('fabric', [FABRIC, Fabric(3e4, 1e6)])
@pytest.mark.parametrize('pressure', [5e3, 1e5])
def test_tension_and_decay_length_of_each_mode_agree(fabric, pressure):
    kernel, n = Flattening(RADIUS, pressure, fabric), np.arange(2, 9)
    assert kernel.stiffness == pytest.approx(np.pi * pressure * (n**2 - 1.0))
    wall, shear = fabric
    share = wall / (wall + shear * n**2 * kernel.decay_length**2 / RADIUS**2)
    expected = 0.5 * np.pi * pressure * RADIUS**2 * (1.0 + 1.0 / n**2)
    expected += np.pi * RADIUS * shear * share / n**2
    assert kernel.tension == pytest.approx(expected, rel=1e-12)


def test_modes_are_strings_on_a_foundation():
    alone = Flattening(RADIUS, PRESSURE, FABRIC)
    reach = alone.decay_length
    # Without averaging over the spacing it is exp(-s / lambda) / (2 sqrt(k G)).
    matrix, spacing = kernel(400, 2e-4), 2e-4
    far = np.array([50, 100, 300])
    sizes = 0.5 / np.sqrt(alone.stiffness * alone.tension)
    plain = np.exp(-far[:, None] * spacing / reach) @ sizes
    assert matrix[0, far] == pytest.approx(plain, rel=1e-3)


def test_flattening_kernel_agrees_with_the_robot_file():
    robot = load_robot('nine_member')
    stiffer = Robot(replace(robot.description, local_stiffness=1.7))
    matrix = kernel(40, 0.005)
    for each, scale in ((robot, 1.0), (stiffer, 1.7)):
        compliance = flattening_of(each, PRESSURE).compliance(np.arange(40), 0.005)
        assert compliance == pytest.approx(matrix / scale)


HEXAGON = 0.15 * np.exp(1j * np.pi / 3.0 * np.arange(6))
SHAPES = {
    'disc': core.Disc(0.3),
    'ellipse': core.Ellipse((0.2, 0.12)),
    'hexagon': core.Polygon(np.column_stack([HEXAGON.real, HEXAGON.imag]).tolist(), 0.01),
}
FORCES = np.array([2.0, 10.0, 50.0])


def depths(name, pressure, factor, interpolated):
    """Return depths of the dents of one corner at three angles and three forces."""
    shape = ScaledShape(SHAPES[name], factor, interpolated)
    table = find_table(ROBOT, 0, pressure, shape, 0)
    middle, half_turn, _ = table.angles
    angles = middle + half_turn * np.array([-0.9, 0.0, 0.6])
    dents = Dents([table] * 3)
    return np.array([dents(np.full(3, force), angles)[0] for force in FORCES])


@pytest.mark.parametrize('name', SHAPES)
def test_interpolated_dents_are_those_of_tables(name):
    # Exact for the given object; else within two deviations of 5 % and of 3 %.
    cases = ((1.0, 1.0, 1e-12), (0.9, 1.06, 3e-3), (1.08, 0.95, 3e-3), (1.02, 1.01, 3e-3))
    for pressures, sizes, share in cases:
        interpolated, exact = (
            depths(name, pressures * PRESSURE, sizes, kind) for kind in (True, False)
        )
        assert interpolated == pytest.approx(exact, rel=share)


def test_interpolated_dents_are_continuous_where_their_tables_change():
    # At exp(0.2) times the pressure, the middle of the parabola changes.
    below, above = (depths('disc', PRESSURE * np.exp(x), 1.0, True) for x in (0.1999, 0.2001))
    assert above == pytest.approx(below, rel=3e-4)


def on_disc(*angles):
    """Return contacts on a disc of radius 1 and their normals, at angles in degrees."""
    turn = np.radians(angles)
    around = np.column_stack([np.cos(turn), np.sin(turn)])
    return around, around


@pytest.mark.parametrize(('friction', 'radius'), [(0.1, 1.0), (0.5, 0.15), (2.0, 1.0)])
def test_epsilon_of_antipodal_contacts_has_a_closed_form(friction, radius):
    # The wrenches span a tetrahedron with two orthogonal edges at distance 2.
    points, normals = on_disc(0.0, 180.0)
    space = wrench_space(radius * points, normals, friction, radius)
    assert space.epsilon == pytest.approx(friction / math.hypot(friction, math.sqrt(2.0)))
    assert space.volume == pytest.approx(8.0 * friction**2 / 3.0)


@pytest.mark.parametrize(('angle', 'closed'), [(1.0, True), (-1.0, False)])
def test_two_contacts_close_if_the_chord_is_in_both_cones(angle, closed):
    # Nguyen (1988): the chord between contacts at an angle of 180 degrees - 2 a is inclined by a.
    friction = 0.5
    inclined = math.degrees(math.atan(friction)) - angle
    space = wrench_space(*on_disc(0.0, 180.0 - 2.0 * inclined), friction, 1.0)
    assert space.closed is closed


def largest_load(points, normals, friction, direction, norm):
    """Return the largest load in a direction that the contacts balance, by a linear program."""
    tangents = np.column_stack([-normals[:, 1], normals[:, 0]])
    forces = np.concatenate([friction * tangents - normals, -friction * tangents - normals])
    arms = np.concatenate([points, points])
    moments = arms[:, 0] * forces[:, 1] - arms[:, 1] * forces[:, 0]
    wrenches = np.column_stack([forces, moments]).T
    count = len(points)
    cones = np.hstack([np.eye(count), np.eye(count)])
    limits = cones.sum(axis=0, keepdims=True) if norm == 'L1' else cones
    solution = linprog(
        np.append(np.zeros(2 * count), -1.0),
        A_ub=np.column_stack([limits, np.zeros(len(limits))]),
        b_ub=np.ones(len(limits)),
        A_eq=np.column_stack([wrenches, -direction]),
        b_eq=np.zeros(3),
    )
    return solution.x[-1]


@robots.examples(100)
@given(st.integers(0, 10_000), st.sampled_from(['L1', 'Linf']))
def test_no_load_of_size_epsilon_exceeds_the_contacts(seed, norm):
    random = np.random.default_rng(seed)
    points, normals = on_disc(*random.uniform(0.0, 360.0, 3))
    points = points * random.uniform(0.5, 1.5, (3, 1))
    space = wrench_space(points, normals, 0.6, 1.0, norm)
    directions = random.normal(size=(20, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for direction in directions:
        assert largest_load(points, normals, 0.6, direction, norm) >= space.epsilon - 1e-9


@pytest.mark.parametrize(
    ('changed', 'message'),
    [
        ({'normals': [(5.0, 0.0), (-5.0, 0.0)]}, 'normal 0 has the length 5: must be 1'),
        ({'normals': [(1.0, 0.0)]}, '2 points and 1 normals: must be equal numbers, 1 or more'),
        ({'points': [(1.0, 0.0), (math.nan, 0.0)]}, 'points .* must be 2 x 2 finite numbers'),
        ({'arm': 0.0}, r'characteristic radius 0.0 m: must be from '),
        ({'norm': 'L2'}, "'L2': must be 'L1' or 'Linf'"),
    ],
)
def test_invalid_contacts_are_refused_with_the_valid_form(changed, message):
    points, normals = on_disc(0.0, 180.0)
    values = {'points': points, 'normals': normals, 'friction': 0.5, 'arm': 1.0}
    with pytest.raises(GraspError, match=message):
        wrench_space(**values | changed)
