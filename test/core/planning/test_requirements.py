# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Invalid requirements of grasps are refused with their names."""

from isotruss_ros.core import GraspRequirements
from isotruss_ros.core.errors import GraspError
import pytest

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
        ({'count': 0}, 'count'),
        ({'min_length': '1'}, 'min_length'),
        ({'members': 'north/Z-R'}, 'members .*north/Z-R.*: must be two or three different'),
        (
            {'members': SIDES, 'module': 'north/Z'},
            "module: 'north/Z', and members .*: only one of the two",
        ),
    ],
)
def test_requirements_that_cannot_be_are_refused(values, words):
    with pytest.raises(GraspError, match=words):
        GraspRequirements(**values)
