# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The law of the barriers against its formulas, each term on its own."""

from isotruss_ros.core.safety.barrier_law import BarrierLaw
import numpy as np
import pytest

LAW = BarrierLaw(bound=0.3, band=0.2)
#: Of the defaults: rate, and the margin at which motion comes to rest.
RATE, REST = 5.0, 0.01 * 0.2


def test_margins_count_from_the_bound():
    assert LAW.margin(np.array([0.35, 0.25])) == pytest.approx([0.05, -0.05])
    assert LAW.active_below == pytest.approx(0.5)
    assert LAW.safety_margin == pytest.approx(REST)


@pytest.mark.parametrize('share', [0.02, 0.1, 0.5, 0.9, 1.0])
def test_margins_fall_by_the_class_k_function(share):
    left = share * 0.2 - REST
    expected = RATE * left / (1.0 - left / 0.2)
    assert LAW.class_k_bound(np.array([share * 0.2])) == pytest.approx(expected, rel=1e-9)


def test_slow_and_quick_bounds_of_a_sample():
    margin = np.array([0.05])
    # Twice what the class-K function allows, of the whole margin, in a short sample ...
    whole = RATE * 0.05 / (1.0 - 0.05 / 0.2)
    assert LAW.discrete_bound(margin, 0.01, 0.0) == pytest.approx(
        0.05 - 2.0 * 0.01 * whole, rel=1e-9
    )
    # ... a tenth of it in a long one, and of the safety margin in any.
    assert LAW.discrete_bound(margin, 10.0, 0.0) == pytest.approx(0.1 * 0.05, rel=1e-9)
    low = np.array([0.15 * REST])
    assert LAW.discrete_bound(low, 10.0, 0.0) == pytest.approx(0.1 * REST, rel=1e-9)
    assert LAW.discrete_bound(np.array([1.0]), 0.01, 0.0) == pytest.approx(0.1, rel=1e-9)


@pytest.mark.parametrize('travel', [0.0, 1e-4, 1e-3])
def test_what_is_beyond_the_bound_may_lose_the_square_of_the_travel(travel):
    for margin in (0.09 * REST, 0.0, -0.1):
        left = LAW.discrete_bound(np.array([margin]), 0.01, travel)[0]
        assert margin - left == pytest.approx(1e-9 + 0.2 * (travel / 0.05) ** 2, rel=0.01)
