# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Dents of the skin: the table against the contact it was made from, and what does not count."""

from hypothesis import given, strategies
from isotruss_ros.core import Ellipse, load_robot, Polygon
from isotruss_ros.core.contact import dents
from isotruss_ros.core.contact.dents import (
    Dents,
    DentTable,
    disc_dents,
)
from isotruss_ros.core.contact.flattening import flattening_of
from isotruss_ros.core.contact.pressed_skin import DentSamples, DEPTH_EXPONENT, PressedSkin
from isotruss_ros.core.fixed_object.contact import solve_contact
from isotruss_ros.core.fixed_object.contact_points import ContactPoints
import numpy as np
import pytest
import robots
from scipy.interpolate import CubicSpline
from shapes import circle

ROBOT = load_robot('nine_member')
KERNEL = flattening_of(ROBOT, 34.5e3)
WHOLE = (np.inf, np.inf)


@robots.examples(60)
@given(robots.generators(), strategies.integers(1, 6), strategies.integers(2, 30))
def test_dents_agree_with_the_cubic_spline_of_scipy(rng, count, size):
    """Of up to six contacts, pulling ones and those beyond the table among them."""
    tables, splines, lasts = [], [], []
    for _ in range(count):
        depths = np.cumsum(rng.uniform(5e-4, 1e-3, size))
        forces = 1e5 * rng.uniform(0.5, 2.0) * depths ** rng.uniform(1.2, 1.8)
        skins = [PressedSkin(np.zeros(1), 1e-3, np.zeros(1), force[None]) for force in forces]
        press = dict(zip(depths.tolist(), skins, strict=True)).__getitem__
        samples = DentSamples(depths, press, KERNEL)
        tables.append(DentTable(depths, [samples], press))
        places = np.append(0.0, forces**DEPTH_EXPONENT)
        splines.append(CubicSpline(places, np.append(0.0, depths), bc_type='natural'))
        lasts.append(places[-1])
    pressing = 2.0 * rng.uniform(-1.0, 1.0, count) * np.array(lasts) ** (1.0 / DEPTH_EXPONENT)
    found, slopes = Dents(tables, scale=1.0)(pressing)
    for force, spline, last, depth, slope in zip(
        pressing, splines, lasts, found, slopes, strict=True
    ):
        place = np.abs(force) ** DEPTH_EXPONENT
        inside, steep = min(place, last), spline(min(place, last), 1)
        wanted = np.sign(force) * (spline(inside) + steep * (place - inside))
        assert depth == pytest.approx(wanted, rel=1e-9, abs=1e-15)
        assert slope == pytest.approx(
            steep * DEPTH_EXPONENT * place / np.abs(force), rel=1e-9, abs=1e-15
        )


def test_dents_of_softer_tubes_are_those_of_larger_forces():
    tables = [disc_dents(KERNEL, radius) for radius in (0.15, 0.2)]
    forces = np.array([10.0, 20.0])
    depth, slope = Dents(tables, scale=0.5)(forces)
    expected = np.array([table(2.0 * force) for table, force in zip(tables, forces, strict=True)])
    assert depth == pytest.approx(expected[:, 0])
    assert slope == pytest.approx(2.0 * expected[:, 1])


@pytest.mark.parametrize('radius', [0.03, 0.15])
def test_dent_of_a_rigid_tube_agrees_with_the_table(radius):
    tube = 0.5 * ROBOT.description.tube_diameter
    table = disc_dents(KERNEL, radius)
    places, alike = 1e-3 * np.arange(-150, 151), np.zeros(301, dtype=int)
    compliance = np.zeros((602, 602))
    compliance[301:, 301:] = KERNEL.compliance(np.arange(301), 1e-3)
    for depth in (0.002, 0.01, 0.02):
        surface = circle(1j * (tube + radius - depth), radius)
        axis = np.ones(301, dtype=complex)
        points = ContactPoints(places + 1j * tube, axis, alike, compliance + 1e-12 * np.eye(602))
        contact = solve_contact(points, surface, surface.nearest(places - surface.center).normals)
        push = (contact.forces * contact.normals).sum()
        assert abs(push.real) < 1e-6 * abs(push)
        assert table(-push.imag)[0] == pytest.approx(depth, rel=0.02)


#: Angles of normals: of a smooth shape, and of a corner, also near both of its faces.
TURNS = [(Ellipse((0.2, 0.1)), x) for x in (0.0, 0.3, 1.57, -3.1)]
TURNS += [(Polygon([(0, 0), (0.3, 0), (0, 0.3)]), x) for x in (-2.4, -3.0, -3.1, -1.65, -1.58)]


@pytest.mark.parametrize('force', [0.3, 5.0, 40.0, 1e3, -5.0])
@pytest.mark.parametrize(('shape', 'angle'), TURNS)
def test_derivative_by_the_angle_agrees_with_finite_differences(shape, angle, force):
    def table(turned):
        return dents.corner_dents(KERNEL, shape, turned, 0, WHOLE)

    step = 1e-6
    slope = (table(angle + step)(force)[0] - table(angle - step)(force)[0]) / (2.0 * step)
    depth = abs(table(angle)(force)[0])
    assert table(angle).rates(force)[1] == pytest.approx(slope, rel=1e-4, abs=1e-6 * depth)


@pytest.mark.parametrize('force', [0.3, 20.0])
@pytest.mark.parametrize(('shape', 'angle'), TURNS)
def test_dents_between_samples_agree_with_those_of_their_angle(shape, angle, force):
    """The step between the samples is a third of what it is."""
    step = dents.ANGLE_STEP
    for away in step * np.linspace(0.0, 1.0, 7):
        with pytest.MonkeyPatch.context() as patch:
            coarse = dents.corner_dents.__wrapped__(KERNEL, shape, angle + away, 0, WHOLE)
            patch.setattr(dents, 'ANGLE_STEP', step / 3.0)
            fine = dents.corner_dents.__wrapped__(KERNEL, shape, angle + away, 0, WHOLE)
        assert coarse(force)[0] == pytest.approx(fine(force)[0], rel=0.02)


@pytest.mark.parametrize('force', [0.3, 5.0, 40.0, 1e3, -5.0])
@pytest.mark.parametrize('shape', ['disc', 'corner'])
def test_pressure_derivative_agrees_with_finite_differences(shape, force):
    def table(pressure):
        kernel = flattening_of(ROBOT, pressure)
        if shape == 'disc':
            return disc_dents(kernel, 0.15)
        return dents.corner_dents(kernel, Ellipse((0.2, 0.1)), 1.57, 0, WHOLE)

    # So short that the same points are closed on both sides.
    pressure, step = 34e3, 5.0
    slope = (table(pressure + step)(force)[0] - table(pressure - step)(force)[0]) / (2.0 * step)
    assert table(pressure).rates(force)[0] == pytest.approx(slope, rel=1e-5)
    assert slope * force < 0.0
