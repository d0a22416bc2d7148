# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where stiffness laws end: ranges of numbers, and beams that do not shear but for rounding."""

from isotruss_ros.core.errors import RobotFileError
from isotruss_ros.core.model.robot_file import read_robot_file
from isotruss_ros.core.model.stiffness_law import find_contradictions, Law
import numpy as np
import pytest
import robots

EULER = 25.0


def complaints(axial=1e3, rotary=4.0 * EULER):
    """Return what is wrong with laws that with 4 EI are those of a beam that does not shear."""
    laws = {
        'axial': Law(axial, 0.0, 0.0),
        'transverse': Law(12.0 * EULER, 0.0, -3.0),
        'rotary': Law(rotary, 0.0, -1.0),
    }
    return list(find_contradictions(laws, {'main': 34.5e3}, (0.3, 3.0), 0.1))


def test_stiffness_law_is_a_product_of_powers():
    found = Law(3.0, 0.5, -1.5).stiffness(np.array([0.25, 4.0]), np.array([1e4, 4e4]))
    assert found == pytest.approx([3.0 * 100.0 * 8.0, 3.0 * 200.0 / 8.0])


@pytest.mark.parametrize('axial', [1.05e-12, 0.95e12])
def test_stiffnesses_within_twenty_four_decades_are_accepted(axial):
    assert complaints(axial) == []


@pytest.mark.parametrize('axial', [0.95e-12, 1.05e12])
def test_stiffnesses_beyond_twenty_four_decades_are_refused(axial):
    (line,) = complaints(axial)
    assert 'must be from 1e-12 to 1e+12; laws are in SI units' in line


@pytest.mark.parametrize('less', [0.0, 0.95e-9, 1.05e-9])
def test_euler_bernoulli_beams_are_accepted_up_to_rounding(less):
    found = complaints(rotary=4.0 * EULER * (1.0 - less))
    assert len(found) == (less > 1e-9)
    assert all('contradict each other at every length' in line for line in found)


def test_numbers_in_files_are_bounded():
    document = robots.example()
    stiffness = document['tube']['stiffness']
    stiffness['axial_rigidity'] = 0.95e12
    found = read_robot_file(robots.write(document)).stiffness
    assert found['axial_rigidity'] == 0.95e12
    stiffness['axial_rigidity'] = 1.05e12
    with pytest.raises(RobotFileError, match='axial_rigidity'):
        read_robot_file(robots.write(document))
