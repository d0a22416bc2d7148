# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What a grasp must fulfil where nothing else is said, and which bounds it exceeds."""

from types import SimpleNamespace

from isotruss_ros.core import GraspRequirements
from isotruss_ros.core.planning.grasp_plan import RequirementError
import numpy as np
import pytest


@pytest.mark.parametrize(
    ('values', 'free'),
    [
        ({}, True),
        ({'min_margin': 0.1}, False),
        ({'min_margin': 0.1, 'squeeze': 5.0}, True),
        ({'min_margin': 0.1, 'min_slip_margin': 0.05}, True),
    ],
)
def test_the_ground_holds_the_object_where_only_the_closure_margin_counts(values, free):
    assert GraspRequirements(**values).object_is_free == free


def fast(forces, used):
    """Return what an analysis would say of members that press with some forces [N]."""
    return SimpleNamespace(
        contact_forces=dict(enumerate(forces)),
        normal_forces=np.array(forces),
        utilisation={'main/T-L': used},
    )


@pytest.mark.parametrize(
    ('forces', 'free', 'used', 'exceeded'),
    [
        ((3.0, 3.0, 2.0), (3.0, 3.0, 2.0), 0.5, None),
        ((4.0, 1.0), (), 0.6, ('max_contact_force', 4.0, 3.0)),
        ((1.0, 1.0), (3.5, 1.0), 0.6, ('max_contact_force', 3.5, 3.0)),
        ((2.0,) * 5, (), 0.6, ('max_total_force', 10.0, 8.0)),
        ((2.0, 2.0), (2.0, 2.0), 0.625, ('max_utilisation', 0.625, 0.5)),
    ],
)
def test_loads_are_the_larger_ones_and_exceed_bounds_from_where_these_are(
    forces, free, used, exceeded
):
    needs = GraspRequirements(max_contact_force=3.0, max_total_force=8.0, max_utilisation=0.5)
    for analysis, utilisation in ((fast(forces, used), [0.1]), (fast(forces, 0.1), [used])):
        if exceeded is None:
            loads = needs.find_loads(analysis, free, utilisation)
            assert tuple(loads.values()) == (3.0, 8.0, 0.5)
            continue
        with pytest.raises(RequirementError) as missed:
            needs.find_loads(analysis, free, utilisation)
        distance = pytest.approx(1.0 - exceeded[2] / exceeded[1])
        assert missed.value.args == (*exceeded, distance)


def test_what_does_not_press_has_no_loads():
    found = GraspRequirements().find_loads(fast((), 0.0), [], [])
    assert set(found.values()) == {0.0}
