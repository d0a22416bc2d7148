# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Dents of the skin: the table against the contact it was made from, and what does not count."""

from hypothesis import given, strategies
from isotruss_ros.core import Disc, Ellipse, load_robot, Polygon
from isotruss_ros.core.contact import dents
from isotruss_ros.core.contact.dents import dent_table, DentTable, Spline
from isotruss_ros.core.contact.flattening import flattening_of
from isotruss_ros.core.fixed_object.contact import solve_contact
from isotruss_ros.core.fixed_object.contact_points import ContactPoints
import numpy as np
import pytest
import robots
from scipy.interpolate import CubicSpline
from shapes import circle

ROBOT = load_robot('nine_member')
KERNEL = flattening_of(ROBOT, 34.5e3)


def disc_table(radius, kernel=KERNEL):
    return dent_table(kernel, Disc(2.0 * radius))


@robots.examples(60)
@given(robots.generators(), strategies.integers(2, 30))
def test_splines_agree_with_scipy_and_are_linear_beyond_their_end(rng, size):
    places, values = (np.append(0.0, np.cumsum(rng.uniform(0.5, 1.0, size))) for _ in range(2))
    expected = CubicSpline(places, values, bc_type='natural')
    for place in 2.0 * places[-1] * rng.uniform(0.0, 1.0, 6):
        inside, (value, slope) = min(place, places[-1]), Spline(places, values)(place, place)
        assert slope == pytest.approx(float(expected(inside, 1)), rel=1e-9, abs=1e-9)
        beyond = slope * (place - inside)
        assert value == pytest.approx(float(expected(inside)) + beyond, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize('force', [0.3, 5.0, 40.0, 1e3, -5.0])
def test_derivative_by_the_force_agrees_with_finite_differences(force):
    table, step = disc_table(0.15), 1e-6 * force
    ahead, behind = table(force + step, 0.0)[0], table(force - step, 0.0)[0]
    assert table(force, 0.0)[1] == pytest.approx((ahead - behind) / (2.0 * step), rel=1e-6)
    assert table(-force, 0.0)[0] == -table(force, 0.0)[0]


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
        assert table(-push.imag, 0.0)[0] == pytest.approx(depth, rel=0.02)


#: Angles of normals: of a smooth shape, and of a corner, also near both of its faces.
TURNS = [(Ellipse((0.2, 0.1)), x) for x in (0.0, 0.3, 1.57, -3.1)]
TURNS += [(Polygon([(0, 0), (0.3, 0), (0, 0.3)]), x) for x in (-2.4, -3.0, -3.1, -1.65, -1.58)]


@pytest.mark.parametrize('force', [0.3, 5.0, 40.0, 1e3, -5.0])
@pytest.mark.parametrize(('shape', 'angle'), TURNS)
def test_derivative_by_the_angle_agrees_with_finite_differences(shape, angle, force):
    table, step = dent_table(KERNEL, shape), 1e-6
    slope = (table(force, angle + step)[0] - table(force, angle - step)[0]) / (2.0 * step)
    depth, _, turned = table(force, angle)
    assert turned == pytest.approx(slope, rel=1e-4, abs=1e-6 * abs(depth))


@pytest.mark.parametrize('away', [-1e-15, 1e-15, 1e-10])
def test_within_rounding_of_a_face_the_dent_is_that_of_the_face(away):
    table = dent_table(KERNEL, Polygon([(0, 0), (0.3, 0), (0, 0.3)]))
    for face in (-0.5 * np.pi, -np.pi):
        assert table(5.0, face + away) == table(5.0, face)
        assert table(5.0, face + away)[2] == 0.0


@pytest.mark.parametrize('shape', [Ellipse((0.2, 0.1)), Polygon([(0, 0), (0.3, 0), (0, 0.3)])])
def test_second_derivatives_by_the_angle_are_continuous_at_the_samples(shape):
    table, step = dent_table(KERNEL, shape), 1e-7
    angle = table._sampled_angle(17)
    at, before, behind = (table(5.0, angle + s)[2] for s in (0.0, -step, step))
    assert at - before == pytest.approx(behind - at, rel=1e-3)


@pytest.mark.parametrize('force', [0.3, 20.0])
@pytest.mark.parametrize(('shape', 'angle'), TURNS)
def test_dents_between_samples_agree_with_those_of_their_angle(shape, angle, force):
    """The step between the samples is a third of what it is."""
    step = dents.ANGLE_STEP
    for away in step * np.linspace(0.0, 1.0, 7):
        with pytest.MonkeyPatch.context() as patch:
            coarse = DentTable(KERNEL, shape)(force, angle + away)[0]
            patch.setattr(dents, 'ANGLE_STEP', step / 3.0)
            fine = DentTable(KERNEL, shape)(force, angle + away)[0]
        assert coarse == pytest.approx(fine, rel=0.02)


@pytest.mark.parametrize('force', [0.3, 5.0, 40.0, 1e3, -5.0])
@pytest.mark.parametrize('shape', [Disc(0.3), Ellipse((0.2, 0.1))])
def test_pressure_derivative_agrees_with_finite_differences(shape, force):
    def table(pressure):
        return dent_table(flattening_of(ROBOT, pressure), shape)

    # So short that the same points are closed on both sides.
    pressure, step = 34e3, 5.0
    wide, narrow = (table(pressure + way)(force, 1.57)[0] for way in (step, -step))
    slope = (wide - narrow) / (2.0 * step)
    assert table(pressure).pressure_rate(force, 1.57) == pytest.approx(slope, rel=1e-5)
    assert slope * force < 0.0
