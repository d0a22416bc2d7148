# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stiffness laws of beams without shear deformation, up to rounding."""

from isotruss_ros.core.model.stiffness_law import find_contradictions, Law
import pytest

EULER = 25.0


def complaints(rotary):
    """Return what is wrong with laws that with 4 EI are those of a beam that does not shear."""
    laws = {
        'axial': Law(1e3, 0.0, 0.0),
        'transverse': Law(12.0 * EULER, 0.0, -3.0),
        'rotary': Law(rotary, 0.0, -1.0),
    }
    return list(find_contradictions(laws, {'main': 34.5e3}, (0.3, 3.0), 0.1))


@pytest.mark.parametrize('less', [0.0, 0.95e-9, 1.05e-9])
def test_euler_bernoulli_beams_are_accepted_up_to_rounding(less):
    found = complaints(rotary=4.0 * EULER * (1.0 - less))
    assert len(found) == (less > 1e-9)
    assert all('contradict each other at every length' in line for line in found)
