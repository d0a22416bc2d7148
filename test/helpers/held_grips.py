# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Objects that are pressed into members of the nine-member robot at home, and held there."""

from apart_grips import APART, NINE
from isotruss_ros.core import place_between, Polygon
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.held_grip import HeldGrip
import numpy as np

HOME = NINE.home
BOX = Polygon([(-0.25, -0.2), (0.25, -0.2), (0.25, 0.2), (-0.25, 0.2)], corner_radius=0.02)
#: A triangle's own sides.
LOOP = ('south/P-Q', 'south/Q-X', 'south/X-P')


def numbers(members):
    """Return the numbers of members."""
    return np.array([NINE.member_names.index(name) for name in members])


def held(shape, angle, members=APART, depth=0.01, **options):
    """Return how an object is held that is pressed into members."""
    grip = place_between(HOME, members, shape, angle=angle, indentation=depth)
    found = attach_grip(HOME, grip.body, numbers(members), **options)
    assert isinstance(found, HeldGrip)
    return found
