# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Discs: numbers of any kind within range are taken, and what is out of range is refused."""

from isotruss_ros.core import ConvexObject
from isotruss_ros.core.errors import GraspError
import numpy as np
import pytest

#: The bounds that messages have, [m].
MIN_DIAMETER, MAX_DISTANCE = 1e-9, 1e9
SIZES = (MIN_DIAMETER, 0.05, 1.0, MAX_DISTANCE)


@pytest.mark.parametrize('number', [float, np.float64])
@pytest.mark.parametrize('size', SIZES)
def test_diameters_within_range_are_taken_as_they_are(number, size):
    disc = ConvexObject.disc((number(0.0), number(-0.25)), number(size))
    assert disc.pose == (0.0, -0.25, 0.0)
    assert disc.shape.diameter == size
    assert {type(value) for value in (*disc.pose, disc.shape.diameter)} == {float}


@pytest.mark.parametrize('number', [float, np.float64])
@pytest.mark.parametrize(
    ('center', 'size', 'words'),
    [
        ((0.0, 0.0), 0.0, 'must be positive'),
        ((0.0, 0.0), -0.1, 'must be positive'),
        ((0.0, 0.0), 0.99 * MIN_DIAMETER, 'must be from'),
        ((0.0, 0.0), 1.01 * MAX_DISTANCE, 'must be from'),
        ((1.01 * MAX_DISTANCE, 0.0), 0.1, 'must be within'),
        ((0.0, -1.01 * MAX_DISTANCE), 0.1, 'must be within'),
        ((-1.01 * MAX_DISTANCE, 0.0), 0.1, 'must be within'),
        ((0.0, 1.01 * MAX_DISTANCE), 0.1, 'must be within'),
        ((0.0, 0.0, 0.0), 0.1, "the object's centre"),
        ((0.0,), 0.1, "the object's centre"),
        ((np.nan, 0.0), 0.1, "the object's centre .* must be 2 finite numbers"),
        ((0.0, 0.0), np.inf, "the object's diameter .* must be 1 finite number"),
    ],
)
def test_what_is_out_of_range_is_refused(number, center, size, words):
    with pytest.raises(GraspError, match=words):
        ConvexObject.disc(tuple(map(number, center)), number(size))


def test_places_up_to_the_largest_distance_are_taken():
    for center in ((MAX_DISTANCE, -MAX_DISTANCE), (-MAX_DISTANCE, MAX_DISTANCE)):
        assert ConvexObject.disc(center, 0.1).center == complex(*center)
        assert ConvexObject.disc(np.array(center), 0.1).center == complex(*center)


@pytest.mark.parametrize('what', [None, 'here', 'wide', 10**400])
def test_what_is_no_number_is_refused(what):
    with pytest.raises(GraspError, match=r'centre .* must be 2 finite numbers'):
        ConvexObject.disc(what, 0.2)
    with pytest.raises(GraspError, match=r'diameter .* must be 1 finite number'):
        ConvexObject.disc((0.0, 0.0), what)
