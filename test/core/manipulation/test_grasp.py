# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The rows of (19) against what a held object does when rollers move a little."""

from hypothesis import given, reject, strategies
from isotruss_ros.core import (
    Configuration,
    ConvexObject,
    GraspError,
    Grip,
    grip_jacobian,
    load_robot,
    RollingGrip,
    tangent_center,
)
from isotruss_ros.core.manipulation.grasp import find_grasping_members, members_at_module
from isotruss_ros.core.manipulation.task import grasp_rows
import numpy as np
import pytest
import robots

EPSILON = 1e-5
NUMBERS = strategies.integers(0, 10**6)


def opening(config, module):
    """Return the angle from the side at B to the side at C."""
    sides = members_at_module(config, module)
    return np.angle(sides.back / sides.ahead)


def turned(after, before):
    return np.angle(np.exp(1j * (after - before)))


@robots.examples(60)
@given(robots.robots(), robots.generators(), NUMBERS)
def test_jacobian_is_the_derivative_of_the_held_pose(robot, rng, number):
    config, grasp, _ = robots.random_grasp(robot, rng, number)
    held = RollingGrip.attach(config, grasp, angle=0.3)
    jacobian = grip_jacobian(config, grasp)
    assert jacobian.shape == (4, len(robot.roller_names))
    size = np.abs(jacobian).max()
    for column in range(len(robot.roller_names)):
        step = EPSILON * np.eye(len(robot.roller_names))[column]
        ahead = config.moved_to(config.roller_positions + step)
        behind = config.moved_to(config.roller_positions - step)
        after, before = held.pose(ahead), held.pose(behind)
        wanted = [
            after.x - before.x,
            after.y - before.y,
            turned(after.angle, before.angle),
            turned(opening(ahead, grasp.module), opening(behind, grasp.module)),
        ]
        found = jacobian[:, column] * 2.0 * EPSILON
        assert found == pytest.approx(np.array(wanted), abs=2e-6 * EPSILON * size + 1e-11)


@pytest.mark.parametrize('way', [1, -1])
def test_objects_are_found_between_the_members_of_small_robots(way):
    """A tenth as large as the others, the area between two members is less than 0.1 m^2."""
    document = robots.example()
    document['joints'] = {name: [0.1 * x, 0.1 * y] for name, (x, y) in document['joints'].items()}
    document['tubes']['south']['joints'] = ['P', 'Q', 'X'][::way]
    document['module'].update(pinch_separation=0.012, rod_length=0.01, guide_ring_distance=0.008)
    document['members'].update(min_length=0.025)
    robot = robots.load(document)
    center = complex(robot.home.points[:3].mean())
    for module in robot.module_names:
        members = find_grasping_members(
            robot.home,
            Grip.at_module(
                config.robot, module, ConvexObject.disc((center.real, center.imag), 0.01)
            ),
        )
        assert members.side == way
        start, _, other, _ = robot.home.points[list(members.nodes)]
        for node, side in ((start, members.ahead), (other, members.back)):
            # The mirror image in one member is between the other one and its own.
            image = node + ((center - node) / side).conjugate() * side
            with pytest.raises(GraspError, match='is not between the two members'):
                find_grasping_members(
                    robot.home,
                    Grip.at_module(
                        config.robot, module, ConvexObject.disc((image.real, image.imag), 0.01)
                    ),
                )


@robots.examples(40)
@given(robots.robots(), robots.generators(), NUMBERS)
def test_rows_are_linear_in_any_motion_of_the_nodes(robot, rng, number):
    config, grasp, ends = robots.random_grasp(robot, rng, number)
    rows = grasp_rows(config, grasp)
    sides = members_at_module(config, grasp.module)
    # A rigid motion of everything carries the object with it and opens nothing.
    shift, spin, center = complex(*rng.standard_normal(2)), rng.standard_normal(), ends[0]
    velocity = shift + 1j * spin * (config.points - center)
    carried = shift + 1j * spin * (grasp.center - center)
    assert rows.nodes @ velocity.view(float) == pytest.approx(
        [carried.real, carried.imag, spin, 0.0], abs=1e-9
    )
    # Only B, B', C and C' carry the object.
    others = np.delete(np.arange(len(config.points)), sides.nodes)
    assert not rows.nodes.reshape(4, -1, 2)[:, others].any()


@robots.examples(60)
@given(robots.robots(), robots.generators(), NUMBERS)
def test_rolling_turns_left_and_right_as_the_paper_says(robot, rng, number):
    config, grasp, ends = robots.random_grasp(robot, rng, number)
    axis = ends[1] - ends[0]
    on_the_left = (np.conj(axis) * (grasp.center - ends[0])).imag > 0.0
    wanted = (2.0 if on_the_left else -2.0) / grasp.diameter
    rows = grasp_rows(config, grasp)
    assert rows.rolling == pytest.approx([0.0, 0.0, wanted, 0.0])
    # In a Jacobian it is only at the roller of the grip, and not there if that is passive.
    plain = config.factor.solve_transposed(rows.nodes.T)[: robot.topology.n_modules]
    carried = plain.T @ robot.topology.incidence
    rolled = grip_jacobian(config, grasp) - carried
    expected = np.zeros_like(rolled)
    if grasp.module in robot.roller_names:
        expected[2, robot.roller_names.index(grasp.module)] = wanted
    assert rolled == pytest.approx(expected, abs=1e-9 * (1.0 + np.abs(carried).max()))


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
def test_rows_at_a_right_angle_are_those_done_by_hand(clockwise):
    config, place = right_angle(clockwise)
    grasp = Grip.at_module(config.robot, 't/A', ConvexObject.disc((0.3, 0.5), 0.25))
    rows = grasp_rows(config, grasp)
    side = 1.0 if not clockwise else -1.0
    assert rows.rolling == pytest.approx([0.0, 0.0, side * 8.0, 0.0])

    def motion(**moving):
        velocity = np.zeros(len(config.points), dtype=complex)
        for name, value in moving.items():
            velocity[place[name.replace('_', '/')]] = value
        return rows.nodes @ velocity.view(float)

    if not clockwise:
        # B' of the 1 m long side moves up at 1 m/s: the frame turns about B at 1 rad/s, the
        # object at (0.2, 0.5) from B moves by 1 rad/s across it, and the grip closes.
        assert motion(t_E_C=1j) == pytest.approx([-0.5, 0.2, 1.0, -1.0])
        assert motion(t_E_C=1.0) == pytest.approx([0.0, 0.0, 0.0, 0.0])
        assert motion(t_F_B=1.0) == pytest.approx([0.0, 0.0, 0.0, -1.0])
        assert motion(t_A_B=1j) == pytest.approx([0.5, 0.8, -1.0, 1.0])
    else:
        # The frame is on the side along y; the object at (0.3, 0.4) from its B.
        assert motion(t_F_C=1.0) == pytest.approx([0.4, -0.3, -1.0, 1.0])
        assert motion(t_F_C=1j) == pytest.approx([0.0, 0.0, 0.0, 0.0])
        assert motion(t_E_B=1j) == pytest.approx([0.0, 0.0, 0.0, 1.0])
        assert motion(t_A_B=1.0) == pytest.approx([0.6, 0.3, 1.0, -1.0])


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
@given(robots.robots(), robots.generators(), NUMBERS)
def test_tangent_object_touches_both_grasping_members(robot, rng, number):
    config, grasp, ends = robots.random_grasp(robot, rng, number)
    try:
        center = complex(*tangent_center(config, grasp.module, grasp.diameter))
    except GraspError:
        reject()
    for start, end in (ends[:2], ends[2:]):
        axis = (end - start) / abs(end - start)
        arm = (center - start) * axis.conjugate()
        assert abs(arm.imag) == pytest.approx(
            0.5 * (grasp.diameter + robot.description.tube_diameter)
        )
        assert -1e-9 < arm.real < abs(end - start) + 1e-9
    grasp_rows(
        config,
        Grip.at_module(
            config.robot,
            grasp.module,
            ConvexObject.disc((center.real, center.imag), grasp.diameter),
        ),
    )


@robots.examples(60)
@given(robots.robots(), robots.generators(), NUMBERS)
def test_object_outside_the_wedge_is_refused(robot, rng, number):
    config, grasp, ends = robots.random_grasp(robot, rng, number)
    inside = grasp.center
    for start, end in (ends[:2], ends[2:]):
        # Its mirror image across the side is on the side's other side.
        axis = (end - start) / abs(end - start)
        mirrored = start + axis * np.conj((inside - start) * np.conj(axis))
        outside = Grip.at_module(
            config.robot,
            grasp.module,
            ConvexObject.disc((mirrored.real, mirrored.imag), grasp.diameter),
        )
        with pytest.raises(GraspError, match='is not between the two members that meet at module'):
            grasp_rows(config, outside)
        with pytest.raises(GraspError, match=grasp.module):
            RollingGrip.attach(config, outside)


@pytest.mark.parametrize(
    ('module', 'center', 'diameter', 'message'),
    [
        ('main/T', (0.5, 0.3), 0.0, r'diameter 0\.0 m: must be positive'),
        ('main/T', (0.5, 0.3), -0.1, r'diameter -0\.1 m: must be positive'),
        ('main/T', (0.5, 0.3), np.nan, 'diameter .* must be 1 finite number'),
        ('main/T', (0.5, 0.3), np.inf, 'diameter .* must be 1 finite number'),
        ('main/T', (0.5, 0.3), 'wide', 'diameter .* must be 1 finite number'),
        ('main/T', (0.5, 0.3), None, 'diameter .* must be 1 finite number'),
        ('main/T', (0.5, 0.3), 10**400, 'diameter .* must be 1 finite number'),
        ('main/T', (0.5, 0.3), 1e308, 'must be within 1e.09 m'),
        ('main/T', (0.5, 0.3), 1e-320, 'the diameter at least 1e-09 m'),
        ('main/T', (1e200, 0.3), 0.2, 'must be within 1e.09 m'),
        ('main/T', (np.nan, 0.3), 0.2, 'centre .* must be 2 finite numbers'),
        ('main/T', (0.5, -np.inf), 0.2, 'centre .* must be 2 finite numbers'),
        ('main/T', (0.5,), 0.2, 'centre .* must be 2 finite numbers'),
        ('main/T', (0.5, 0.3, 0.0), 0.2, 'centre .* must be 2 finite numbers'),
        ('main/T', 'here', 0.2, 'centre .* must be 2 finite numbers'),
        ('main/T', None, 0.2, 'centre .* must be 2 finite numbers'),
        ('main/W', (0.5, 0.3), 0.2, "module 'main/W': .* its modules are main/L, main/R, main/T"),
        ('T', (0.5, 0.3), 0.2, "module 'T': robot triangle has no such module"),
        (None, (0.5, 0.3), 0.2, 'module None: robot triangle has no such module'),
        ('main/T', (5.0, 0.3), 0.2, 'is not between the two members that meet at module main/T'),
        ('main/T', (0.51, 2.0), 0.2, 'is not between the two members that meet at module main/T'),
    ],
)
def test_grasp_that_cannot_be_is_refused(module, center, diameter, message):
    with pytest.raises(GraspError, match=message):
        grip_jacobian(
            load_robot('triangle').home,
            Grip.at_module(config.robot, module, ConvexObject.disc(center, diameter)),
        )


def test_grasp_takes_numpy_and_gives_floats():
    grasp = Grip.at_module(
        config.robot, 'main/T', ConvexObject.disc(np.array([0.5, 0.3]), np.float32(0.5))
    )
    assert grasp == Grip.at_module(config.robot, 'main/T', ConvexObject.disc((0.5, 0.3), 0.5))
    assert isinstance(grasp.center, tuple)


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
