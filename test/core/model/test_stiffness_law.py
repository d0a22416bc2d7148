# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stiffness laws of beams without shear deformation, up to rounding."""

from dataclasses import replace

from isotruss_ros.core import load_robot
from isotruss_ros.core.model.stiffness_law import find_contradictions
import pytest

EULER = 25.0


def complaints(rotary):
    """Return what is wrong with laws that with 4 EI are those of a beam that does not shear."""
    block = {
        'axial': {'C': 1e3, 'a': 0.0, 'b': 0.0},
        'transverse': {'C': 12.0 * EULER, 'a': 0.0, 'b': -3.0},
        'rotary': {'C': rotary, 'a': 0.0, 'b': -1.0},
    }
    return list(find_contradictions(replace(load_robot('triangle').description, stiffness=block)))


@pytest.mark.parametrize('less', [0.0, 0.95e-9, 1.05e-9])
def test_euler_bernoulli_beams_are_accepted_up_to_rounding(less):
    found = complaints(rotary=4.0 * EULER * (1.0 - less))
    assert len(found) == (less > 1e-9)
    assert all('contradict each other at every length' in line for line in found)
