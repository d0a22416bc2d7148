# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a grasp must fulfil where nothing else is said, and which bounds it exceeds."""

from types import SimpleNamespace

from isotruss_ros.core import GraspRequirements
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.planning.violations import RequirementError
import numpy as np
import pytest


@pytest.mark.parametrize(
    ('forces', 'used', 'exceeded'),
    [
        ((3.0, 3.0, 2.0), 0.5, None),
        ((4.0, 1.0), 0.6, ('max_contact_force', 4.0, 3.0)),
        ((2.0,) * 5, 0.6, ('max_total_force', 10.0, 8.0)),
        ((2.0, 2.0), 0.625, ('max_utilisation', 0.625, 0.5)),
    ],
)
def test_loads_beyond_their_bounds_violate_the_requirement(forces, used, exceeded):
    sections = SimpleNamespace(used=np.array([0.1, used]))
    grasp = SimpleNamespace(normal_forces=np.array(forces), sections=sections)
    needs = GraspRequirements(max_contact_force=3.0, max_total_force=8.0, max_utilisation=0.5)
    if exceeded is None:
        assert tuple(needs.find_loads(grasp).values()) == (3.0, 8.0, 0.5)
        return
    with pytest.raises(RequirementError) as missed:
        needs.find_loads(grasp)
    assert missed.value.args == exceeded


SIDES = ('south/P-Q', 'north/R-P')


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({'friction': -0.1}, 'friction'),
        ({'min_slip_margin': float('inf')}, 'min_slip_margin'),
        ({'max_contact_force': -1.0}, 'max_contact_force'),
        ({'external_wrench': (0.0, 1.0)}, 'external_wrench'),
        ({'direction': (0.0, 0.0, 0.0), 'measure': 'stiffness'}, 'direction'),
        ({'measure': 'beauty'}, 'measure'),
        ({'squeeze': 0.0}, 'squeeze'),
        ({'min_slip_margin': float('nan')}, 'min_slip_margin'),
        ({'count': 0}, 'count'),
        ({'min_length': '1'}, 'min_length'),
        ({'members': 'north/Z-R'}, 'members: .*north/Z-R.*: must be the names t/j-k of 2 or 3'),
        ({'members': ('north/Z-R',)}, 'must be the names t/j-k of 2 or 3 different members'),
        ({'members': ('a', 'b', 'c', 'd')}, 'must be the names'),
        (
            {'members': SIDES, 'module': 'north/Z'},
            "module: 'north/Z', and members .*: only one of the two",
        ),
    ],
)
def test_requirements_that_cannot_be_are_refused(values, words):
    with pytest.raises(GraspError, match=words):
        GraspRequirements(**values)
