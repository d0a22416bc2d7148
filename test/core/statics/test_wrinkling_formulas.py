# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Utilisation of a compressed tube: beam columns with shear, and the tension of the wall."""

from types import SimpleNamespace

from isotruss_ros.core.statics.wrinkling import evaluate_utilisation, find_utilisation
import numpy as np
import pytest
import tubes

LENGTH, RADIUS, EI, WALL = 0.8, 0.05, 25.0, 300.0


def engesser(angle, shear):
    """Return the compression with the wave number angle / length of a column with shear."""
    flexural = EI * (angle / LENGTH) ** 2
    return flexural / (1.0 + flexural / shear)


@pytest.mark.parametrize('shear', [500.0, 2000.0, np.inf])
@pytest.mark.parametrize('angle', [1.0, 2.0, 3.0])
def test_equal_end_moments_grow_by_the_secant_of_engessers_column(angle, shear):
    loads = (2.0, 2.0, WALL, -engesser(angle, shear))
    used, inside = evaluate_utilisation(loads, np.array([LENGTH, EI, shear]), RADIUS)
    expected = np.array([2.0, 2.0, 2.0 / np.cos(0.5 * angle)]) / (0.5 * RADIUS * WALL)
    assert used == pytest.approx(expected)
    assert inside == pytest.approx(0.5 * LENGTH)


def test_the_wall_of_a_compressed_piece_has_less_tension():
    structure = tubes.bare(LENGTH, 1.9e4, EI, np.inf)
    structure.config.robot.description = SimpleNamespace(tube_diameter=2.0 * RADIUS)
    structure.pressures = (WALL / (np.pi * RADIUS**2),)
    frame = tubes.robot_with_nodes(structure, np.zeros(1, dtype=int), np.array([0.1 * LENGTH]))
    pieces = np.flatnonzero(frame.layout.whole == 0)
    ends, pulls = np.zeros((len(frame.layout.whole), 6)), np.zeros(len(frame.layout.whole))
    piece = pieces[frame.length[pieces].argmax()]
    angle = 2.5 * frame.length[piece] / LENGTH
    ends[piece] = 90.0, 0.0, -2.0, -90.0, 0.0, 2.0
    pulls[piece] = -engesser(2.5, np.inf)
    found = find_utilisation(structure, frame, ends, pulls)
    expected = 2.0 / np.cos(0.5 * angle) / (0.5 * RADIUS * (WALL - 90.0))
    assert found.used[0] == pytest.approx(expected)
    assert found.kind[0] == 2
