# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Where a disc touches both members at a module: by hand, and over random robots."""

from hypothesis import given, strategies
from isotruss_ros.core import Configuration, load_robot, tangent_center
from isotruss_ros.core.errors import GraspError
import numpy as np
import pytest
import robots


def right_angle(clockwise):
    """
    Return a robot whose module t/A has its two sides at a right angle, posed by hand.

    The side B -> B' runs along x, C -> C' along y, both from points 0.1 m off the corner.
    """
    document = robots.example()
    document['joints'] = {'A': [0.0, 0.0], 'E': [2.0, 0.0], 'F': [0.0, 2.0]}
    order = ['A', 'F', 'E'] if clockwise else ['A', 'E', 'F']
    document['tubes'] = {'t': {'joints': order, 'passive': 'E'}}
    document['supports'] = {'A': ['x', 'y'], 'E': ['y']}
    robot = robots.load(document)
    points = robot.home.points.copy()
    place = {name: i for i, name in enumerate(robot.node_names)}
    along_x, along_y = ('C', 'B') if clockwise else ('B', 'C')
    points[place[f't/A/{along_x}']] = 0.1
    points[place[f't/A/{along_y}']] = 0.1j
    points[place[f't/E/{along_y}']] = 1.1
    points[place[f't/F/{along_x}']] = 1.1j
    return Configuration(robot, np.zeros(2), points), place


@pytest.mark.parametrize('clockwise', [False, True])
def test_tangent_object_at_a_right_angle_touches_both_tubes(clockwise):
    config, _ = right_angle(clockwise)
    reach = 0.5 * (0.25 + config.robot.description.tube_diameter)
    assert tangent_center(config, 't/A', 0.25) == pytest.approx((reach, reach))
    nearer = reach - 0.01 / np.sqrt(2.0)
    assert tangent_center(config, 't/A', 0.25, indentation=0.01) == pytest.approx((nearer, nearer))
    with pytest.raises(GraspError, match='indentation'):
        tangent_center(config, 't/A', 0.25, indentation=np.nan)


@robots.examples(60)
@given(robots.robots(), robots.generators(), strategies.integers(0, 10**6))
def test_tangent_object_touches_both_members(robot, rng, number):
    config, grip, ends = robots.random_grasp(robot, rng, number)
    module = grip.members[0].split('-')[0]
    diameter = grip.body.shape.diameter
    center = complex(*tangent_center(config, module, diameter))
    for start, end in (ends[:2], ends[2:]):
        axis = (end - start) / abs(end - start)
        arm = (center - start) * axis.conjugate()
        assert abs(arm.imag) == pytest.approx(0.5 * (diameter + robot.description.tube_diameter))
        assert -1e-9 < arm.real < abs(end - start) + 1e-9


@pytest.mark.parametrize(
    ('module', 'diameter', 'message'),
    [
        ('main/T', 10.0, 'does not fit between the members at module main/T'),
        ('main/T', 1e-6, 'does not fit between the members'),
        ('main/T', -1.0, 'must be positive'),
        ('main/W', 0.2, 'has no such module'),
    ],
)
def test_object_that_does_not_fit_is_refused(module, diameter, message):
    config = load_robot('triangle').home
    with pytest.raises(GraspError, match=message):
        tangent_center(config, module, diameter)


def test_a_member_is_touched_up_to_its_end():
    """The larger the object, the farther from the corner; here both members alike."""
    config = load_robot('triangle').home
    start, end, _, _ = robots.side_ends(config, 'main/T')

    def share(diameter):
        center = complex(*tangent_center(config, 'main/T', diameter))
        return ((center - start) / (end - start)).real

    slope = (share(0.6) - share(0.2)) / 0.4
    fitting, large = (0.2 + (wanted - share(0.2)) / slope for wanted in (0.95, 1.05))
    assert share(fitting) == pytest.approx(0.95)
    with pytest.raises(GraspError, match=r'touch them at \[1\.05, 1\.05\] of their lengths'):
        tangent_center(config, 'main/T', large)
