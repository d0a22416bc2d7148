# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Dents interpolated in size and pressure, against tables computed afresh."""

from isotruss_ros import core
from isotruss_ros.core.contact.dent_interpolation import find_table
from isotruss_ros.core.contact.dents import Dents
from isotruss_ros.core.model.scaled_shape import ScaledShape
import numpy as np
import pytest

ROBOT = core.load_robot('nine_member')
(PRESSURE,) = set(ROBOT.description.pressures.values())
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
    # Within two deviations of 5 % and of 3 %.
    for pressures, sizes in ((0.9, 1.06), (1.08, 0.95), (1.02, 1.01)):
        interpolated, exact = (
            depths(name, pressures * PRESSURE, sizes, kind) for kind in (True, False)
        )
        assert interpolated == pytest.approx(exact, rel=3e-3)


@pytest.mark.parametrize('name', SHAPES)
def test_dents_of_the_given_object_are_not_interpolated(name):
    assert depths(name, PRESSURE, 1.0, True) == pytest.approx(
        depths(name, PRESSURE, 1.0, False), rel=1e-12
    )


def test_interpolated_dents_are_continuous_where_their_tables_change():
    # At exp(0.2) times the pressure, the middle of the parabola changes.
    below, above = (depths('disc', PRESSURE * np.exp(x), 1.0, True) for x in (0.1999, 0.2001))
    assert above == pytest.approx(below, rel=3e-4)
