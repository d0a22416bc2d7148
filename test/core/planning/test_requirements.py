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
from isotruss_ros.core.planning.closed_grip import exceeded_bound, grasp_loads, GraspLoads
from isotruss_ros.core.planning.requirements import Measure, rate_grasp
from isotruss_ros.core.statics.wrinkling import MAX_UTILISATION
import numpy as np
import pytest


def test_values_where_nothing_else_is_said():
    needs = GraspRequirements()
    assert (needs.friction, needs.min_slip_margin, needs.count) == (0.5, 0.0, 3)
    assert needs.external_wrench == (0.0, 0.0, 0.0)
    assert needs.direction == (0.0, 1.0, 0.0)
    assert needs.min_rigidity == 0.15
    assert needs.max_utilisation == MAX_UTILISATION


def test_stiffness_is_that_along_y_where_nothing_else_is_said():
    analysis = SimpleNamespace(stiffness=np.diag([3.0, 5.0, 7.0]))
    needs = GraspRequirements(measure=Measure.STIFFNESS)
    assert rate_grasp(needs, analysis, 0.0, 0.0, 0.0) == pytest.approx(5.0)


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


def test_bounds_are_exceeded_from_where_they_are():
    needs = GraspRequirements(max_contact_force=3.0, max_total_force=8.0, max_utilisation=0.5)
    assert exceeded_bound(needs, GraspLoads(3.0, 8.0, 0.5)) is None
    for loads, name, value, bound in (
        (GraspLoads(4.0, 9.0, 0.6), 'max_contact_force', 4.0, 3.0),
        (GraspLoads(2.0, 10.0, 0.6), 'max_total_force', 10.0, 8.0),
        (GraspLoads(2.0, 7.0, 0.625), 'max_utilisation', 0.625, 0.5),
    ):
        assert exceeded_bound(needs, loads) == (name, value, bound)


def test_what_does_not_press_has_no_loads():
    analysis = SimpleNamespace(
        contact_forces={}, normal_forces=np.zeros(2), utilisation={'main/T-L': 0.0}
    )
    assert grasp_loads(analysis) == GraspLoads(0.0, 0.0, 0.0)
