# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""Which corners of a polygon touch a line, one by one, against the supports of all directions."""

from hypothesis import given, strategies
from isotruss_ros.core import Polygon
import numpy as np
import pytest
import robots

generators = robots.generators()


@robots.examples(200)
@given(generators, strategies.integers(3, 12), strategies.floats(-4.0, 4.0))
def test_the_corner_of_a_direction_is_where_the_support_is(rng, count, angle):
    turns = np.sort((np.arange(count) + rng.uniform(0.1, 0.9, count)) / count) * 2.0 * np.pi
    ring = 0.3 * np.exp(1j * turns) + complex(*rng.uniform(-0.2, 0.2, 2))
    polygon = Polygon([(z.real, z.imag) for z in ring], 0.001)
    normal = np.exp(1j * angle)
    for corner in polygon.corners_at(complex(normal), 1e-9):
        point = polygon.point_at(corner, complex(normal))
        found = (point * normal.conjugate()).real
        assert found == pytest.approx(polygon.support(np.array([normal]))[0], abs=1e-12)
