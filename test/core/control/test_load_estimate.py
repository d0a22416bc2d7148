# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The load on a held object, against least squares and in closed form."""

from isotruss_ros.core.control.load_estimate import LoadEstimate, LoadSettings
import numpy as np
import pytest

RADIUS, PERIOD, GAIN = 0.2, 0.01, 2.0


def test_the_wrench_is_the_most_probable_one():
    """Errors of the pose count against 0.3 mm, turns at the radius, and the wrench against 5 N."""
    rng = np.random.default_rng(0)
    load = LoadEstimate(LoadSettings())
    even = np.array([1.0, 1.0, RADIUS])
    for _ in range(4):
        compliance = 1e-3 * rng.normal(size=(3, 3))
        offset, wrench, bias = 1e-3 * rng.normal(size=3), load.wrench, load.bias.copy()
        # The offset is what is left with the wrench so far.
        rows = np.vstack([even[:, None] * compliance / 3e-4, np.eye(3) / 5.0])
        right = np.append(even * (offset + compliance @ wrench) / 3e-4, np.zeros(3))
        probable = np.linalg.lstsq(rows, right, rcond=None)[0]
        change = load.update(offset, compliance, RADIUS, PERIOD, GAIN)
        # In 10 ms of 20 ms.
        assert change == pytest.approx((1.0 - np.exp(-0.5)) * (probable - wrench))
        assert load.wrench == pytest.approx(wrench + change)
        left = offset - compliance @ change
        assert load.bias == pytest.approx(bias + (1.0 - np.exp(-0.02)) * (left - bias))
