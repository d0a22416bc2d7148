# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What the model of a held object does beyond the rows of (19)."""

from isotruss_ros.core.control.model_trend import ModelTrend
import numpy as np
import pytest

TRAVEL = np.array([3e-4, -4e-4, 0.0])
POSE = np.array([1e-5, -2e-5, 5e-5])


def test_it_is_in_proportion_to_the_travel_in_its_direction():
    trend = ModelTrend.over(TRAVEL, POSE, 0.2)
    # Across the direction nothing is known.
    motion = -2.0 * TRAVEL + np.array([4e-4, 3e-4, 1e-4])
    along = trend.along(motion)
    assert along == pytest.approx(-1e-3)
    assert along * trend.pose == pytest.approx(-2.0 * POSE)
    assert along * trend.squeeze == pytest.approx(-0.4)


@pytest.mark.parametrize('size', [0.0, 0.95e-6])
def test_travel_that_is_lost_in_rounding_tells_nothing(size):
    trend = ModelTrend.over(size * np.array([0.6, 0.8, 0.0]), POSE, 0.2)
    assert trend.along(TRAVEL) == 0.0
    assert trend.squeeze == 0.0
    assert not trend.pose.any()
    assert ModelTrend.over(1.05e-6 * np.array([0.6, 0.8, 0.0]), POSE, 0.2).squeeze > 0.0


@pytest.mark.parametrize(
    ('across', 'fits'), [(0.0, True), (0.29, True), (0.33, False), (-0.33, False)]
)
def test_it_fits_motions_of_its_direction_either_way_and_slow_ones(across, fits):
    trend = ModelTrend.over(np.array([5e-4, 0.0, 0.0]), POSE, 0.2)
    for speed in (10.0, -10.0):
        assert trend.fits(np.array([speed, across * speed, 0.0])) is fits
    # Of these 0.7 is beyond the share: about 1 mm/s.
    assert trend.fits(np.array([0.0, 0.0, 1.4e-3]))
    assert not trend.fits(np.array([0.0, 0.0, 1.45e-3]))
