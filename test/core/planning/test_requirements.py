# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a grasp must fulfil where nothing else is said, and which bounds it exceeds."""

from isotruss_ros.core import GraspRequirements
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.planning.violations import RequirementError
import pytest

LOADS = 'max_contact_force', 'max_total_force', 'max_utilisation'


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
    loads = dict(zip(LOADS, (max(forces), sum(forces), used), strict=True))
    needs = GraspRequirements(max_contact_force=3.0, max_total_force=8.0, max_utilisation=0.5)
    if exceeded is None:
        needs.check_bounds(**loads)
        return
    with pytest.raises(RequirementError) as missed:
        needs.check_bounds(**loads)
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
        ({'members': 'north/Z-R'}, 'members .*north/Z-R.*: must be two or three different'),
        ({'members': ('north/Z-R',)}, 'must be two or three different members'),
        ({'members': ('a', 'b', 'c', 'd')}, 'must be two or three'),
        (
            {'members': SIDES, 'module': 'north/Z'},
            "module: 'north/Z', and members .*: only one of the two",
        ),
    ],
)
def test_requirements_that_cannot_be_are_refused(values, words):
    with pytest.raises(GraspError, match=words):
        GraspRequirements(**values)
