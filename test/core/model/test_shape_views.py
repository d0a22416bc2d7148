# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Other views of a shape: as round as it is already, and its arcs one by one."""

from isotruss_ros.core import Disc, Ellipse, Polygon
import numpy as np
import pytest


@pytest.mark.parametrize('shape', [Disc(0.3), Ellipse((0.3, 0.1))])
def test_what_has_no_corners_is_not_rounded(shape):
    assert shape.rounded(0.05) is shape


def test_arcs_of_a_rounded_square_are_about_its_inner_corners():
    square = Polygon([(0.0, 0.0), (0.4, 0.0), (0.4, 0.4), (0.0, 0.4)], (0.0, 0.05, 0.05, 0.1))
    assert [radius for _, radius in square.arcs] == pytest.approx([0.0, 0.05, 0.05, 0.1])
    centers = np.array([center for center, _ in square.arcs])
    wanted = np.array([0.0, 0.35 + 0.05j, 0.35 + 0.35j, 0.1 + 0.3j])
    assert centers == pytest.approx(wanted, abs=1e-12)
