# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What tubes bear under contact: moments against M_w, pressures, and how far contact goes."""

from types import SimpleNamespace

from isotruss_ros.core import analyze_grasp, ConvexObject, load_robot, tangent_center
from isotruss_ros.core.contact.contact_points import ContactState, find_contact_points
from isotruss_ros.core.contact.contact_regions import find_wrinkling
import numpy as np
import pytest
from shapes import circle
import tubes

LENGTH, RADIUS, PRESSURE = 0.762, 0.051, 34.5e3
PULL = PRESSURE * np.pi * RADIUS**2


def pressed(found, forces, normals):
    """Return a state of contact with given forces."""
    zero = np.zeros(len(forces))
    return ContactState(
        forces, zero, normals, zero.astype(complex), np.full(len(forces), np.inf), forces * normals
    )


def clamped(shear):
    """Return one clamped tube with all that is asked of a robot."""
    structure = tubes.bare(LENGTH, 1.9e4, 25.0, shear)
    module = SimpleNamespace(guide_ring_distance=0.0)
    structure.config.robot.description = SimpleNamespace(tube_diameter=2 * RADIUS, module=module)
    structure.pressures = (PRESSURE,)
    return structure


@pytest.mark.parametrize('shear', [1.9e3, np.inf])
@pytest.mark.parametrize('share', [0.5, 0.3, 0.8])
@pytest.mark.parametrize('angle', [0.0, 0.4, -0.4])
def test_clamped_tube_under_one_force_agrees_with_beam_theory(shear, share, angle):
    structure, force = clamped(shear), 20.0
    found = find_contact_points(structure, circle(share * LENGTH - 0.15j, 0.151), 0.005)
    at = int(np.abs(found.points - share * LENGTH).argmin())
    forces = np.where(np.arange(len(found.points)) == at, force, 0.0)
    normals = np.full(len(forces), 1j * np.exp(1j * angle))
    result, tension = find_wrinkling(structure, found, pressed(found, forces, normals))
    # The tables: end moments F a b^2 / L^2 and F a^2 b / L^2; shear changes them but at midspan.
    a, b = share * LENGTH, (1.0 - share) * LENGTH
    across, along = force * np.cos(angle), -force * np.sin(angle)
    phi = 12.0 * 25.0 / (shear * LENGTH**2)
    start = across * a * b / LENGTH * (b / LENGTH + 0.5 * phi) / (1.0 + phi)
    end = across * a * b / LENGTH * (a / LENGTH + 0.5 * phi) / (1.0 + phi)
    middle = across * a * b / LENGTH - (start * b + end * a) / LENGTH
    # What pushes along is a pull before it and a compression behind it, each by its stiffness.
    compression = along * np.array([-b, a]) / LENGTH
    worst = max(compression)
    used = [
        start / (PULL - compression[0]),
        middle / (PULL - worst),
        end / (PULL - compression[1]),
    ]
    assert result.used == pytest.approx([max(used) / (0.5 * RADIUS)], rel=1e-6)
    if share != 0.5:
        expected_place = [0.0, found.place[at], LENGTH][int(np.argmax(used))]
        assert result.place[0] == pytest.approx(expected_place)
    # On the side of the object the wall loses what bending takes.
    expected = (PULL - worst) / (2 * np.pi * RADIUS) - middle / (np.pi * RADIUS**2)
    assert tension[at] == pytest.approx(max(expected, 0.0), rel=1e-6)


def test_utilisation_is_infinite_if_compression_exceeds_the_pull():
    structure = clamped(1.9e3)
    found = find_contact_points(structure, circle(0.3 * LENGTH - 0.15j, 0.151), 0.005)
    forces = np.zeros(len(found.points))
    forces[len(forces) // 2] = 5.0 * PULL
    state = pressed(found, forces, np.full(len(forces), 1.0 + 0j))
    result, tension = find_wrinkling(structure, found, state)
    assert result.used.tolist() == [np.inf]
    # A slack wall has no tension.
    assert tension.min() == 0.0


def test_contact_pressure_is_gas_pressure_plus_wall_tension_over_curvature():
    robot = load_robot('nine_member')
    gauge = {'south': 30e3, 'east': 25e3, 'north': 20e3}
    center = tangent_center(robot.home, 'south/P', 0.3, 0.01)
    analysis = analyze_grasp(robot.home, ConvexObject.disc(center, 0.3), pressure=gauge)
    points, contact, *_ = analysis.solved
    _, tension = find_wrinkling(analysis.structure, points, contact)
    assert len(analysis.contact_forces) == 2
    for name, force in analysis.contact_forces.items():
        on = (points.member == robot.member_names.index(name)) & (contact.forces > 0.0)
        local = gauge['south'] + tension[on] / 0.15  # p + T / r
        area = (contact.forces[on] / local).sum()
        assert force == pytest.approx(contact.forces[on].sum())
        assert analysis.contact_areas[name] == pytest.approx(area)
        assert analysis.contact_pressures[name] == pytest.approx(force / area)
        assert analysis.peak_pressures[name] == pytest.approx(local.max())
        width = (contact.forces[on] / local).max() / points.spacing
        assert analysis.contact_widths[name] == pytest.approx(width)
