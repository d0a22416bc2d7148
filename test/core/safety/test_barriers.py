# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Barriers: law of their margins, limits learned from the travel, and distances of obstacles."""

from dataclasses import replace
import functools
from types import SimpleNamespace

from contracts import check_barrier
from driven import Driven
from grips import disc_grip, held_at
from held_grips import AROUND, box_between, NINE
from hypothesis import assume, given
from hypothesis import strategies as st
from isotruss_ros import core
from isotruss_ros.core.errors import ConfigurationError, GraspError
from isotruss_ros.core.kinematics.distances import BentParts
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.safety.barrier_law import ActiveValues, ALL_VALUES, BarrierLaw, BarrierLimit
from isotruss_ros.core.safety.barriers import ClearanceBarrier, EvaluatedState, RigidityBarrier
from isotruss_ros.core.safety.margins import object_distances, shape_margins
from isotruss_ros.core.safety.obstacle_barrier import ObstacleBarrier
from isotruss_ros.core.safety.shape_guard import ShapeBounds
from isotruss_ros.core.safety.usage_limits import UsageLimits
from nightly import some_now
import numpy as np
import pytest
from random_grips import random_convex_grip
import robots
from rooms import clearance, random_room

#: So wide that everything is near.
ALL = BarrierLaw(0.0, 1e3)
SelfCollisionBarrier = functools.partial(ClearanceBarrier, needs_object=False)
ObjectBarrier = functools.partial(ClearanceBarrier, needs_object=True)
#: Corners of a square, counter-clockwise.
SQUARE = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
KINDS = (RigidityBarrier, SelfCollisionBarrier, ObjectBarrier)


@pytest.mark.parametrize('needs_object', [False, True])
@robots.examples(10)
@given(robots.robots(), robots.generators())
def test_clearance_barriers_keep_the_contract_of_barriers(needs_object, robot, rng):
    config, grip = random_convex_grip(robot, rng, 'module')
    assume(grip is not None)
    # A polygon touches with its faces and corners, where its distances have kinks.
    assume(not (needs_object and isinstance(grip.body.shape, core.Polygon)))
    barrier = ClearanceBarrier(robot, ALL, needs_object)
    assume(len(barrier.active(config, grip).indices))
    check_barrier(barrier, config, grip if needs_object else None, rng)


@robots.examples(10)
@given(robots.robots(), robots.generators())
def test_row_of_the_rigidity_is_the_derivative_of_the_index(robot, rng):
    config, barrier = robots.random_state(robot, rng), RigidityBarrier(robot, ALL)
    row = config.roller_rows(barrier.active(config, None).node_rows)[0]
    way = 1e-6 * rng.standard_normal(len(robot.roller_names))
    ahead, behind = (
        barrier.values(config.moved_to(config.roller_positions + change), None, [0])
        for change in (way, -way)
    )
    # Vectors take longer to converge than values.
    accuracy = 0.03 * np.linalg.norm(row) * np.linalg.norm(way)
    assert row @ way == pytest.approx(0.5 * (ahead - behind), abs=accuracy)


@pytest.mark.parametrize('kind', KINDS)
def test_active_values_depend_on_the_present_state_alone(kind):
    robot = core.load_robot('nine_member')
    rng = np.random.default_rng(2)
    law = BarrierLaw(0.3, 0.4) if kind is RigidityBarrier else BarrierLaw(0.1, 0.3)
    old = kind(robot, law)
    config = robot.home
    way = rng.uniform(-1.0, 1.0, 6)
    counts = set()
    for step in range(48):
        if step % 16 == 0:
            way = 0.02 * rng.uniform(-1.0, 1.0, 6) - 0.003 * config.roller_positions
        try:
            config = config.moved_to(config.roller_positions + way)
            grip = disc_grip(config, 'east/Q', 0.2)
            near, fresh = old.active(config, grip), kind(robot, law).active(config, grip)
        except (ConfigurationError, GraspError):
            way = -way
            continue
        counts.add(len(fresh.indices))
        assert near.indices == pytest.approx(fresh.indices)
        assert near.values == pytest.approx(fresh.values, abs=1e-12)
        assert near.node_rows == pytest.approx(fresh.node_rows, abs=1e-12)
        everything = old.values(config, grip, ALL_VALUES)
        assert (near.indices == np.flatnonzero(everything < law.active_below)).all()
    assert len(counts) > 1


def test_distances_of_the_object_are_those_of_its_present_grip():
    robot, law = core.load_robot('nine_member'), BarrierLaw(0.0, 0.3)
    body = core.place_between(robot.home, AROUND, core.Disc(0.82), indentation=0.002).body
    other, barrier = core.Grip(AROUND[1:], body), ObjectBarrier(robot, law)
    barrier.active(robot.home, core.Grip(AROUND[:2], body))
    near, fresh = (each.active(robot.home, other) for each in (barrier, ObjectBarrier(robot, law)))
    assert near.indices.tolist() == fresh.indices.tolist()


def moved(shift=0.0, pose=(0.0, 0.0, 0.0), width=0.1, members=AROUND):
    """Return stand-ins of a configuration with two points that approach, and of a grip."""
    config = SimpleNamespace(points=np.array([shift, 1.0 - shift]))
    return config, SimpleNamespace(
        members=members, body=core.ConvexObject(core.Ellipse((0.2, width)), pose)
    )


@pytest.mark.parametrize(
    ('changes', 'approach'),
    [
        ({'shift': 0.1}, 0.2),
        ({'shift': 0.02, 'pose': (0.0, 0.1, 0.0)}, 0.12),
        ({'pose': (0.0, 0.1, 0.5)}, 0.1 + 0.2 * 2.0 * np.sin(0.25)),
        ({'width': 0.11}, np.inf),
        ({'members': AROUND[:2]}, np.inf),
    ],
)
def test_evaluated_distances_are_valid_until_their_spare_is_used(changes, approach):
    config, grip = moved()
    there, later = moved(**changes)
    for share, is_valid in ((0.99, False), (1.01, not np.isinf(approach))):
        state = EvaluatedState(config, grip, share * min(approach, 1e9))
        assert state.holds(there, later, (), None) == is_valid
        if 'shift' in changes:
            alone = EvaluatedState(config, None, share * 2.0 * changes['shift'])
            assert alone.holds(there, None, (), None) == is_valid


@pytest.mark.parametrize('bends', [(0.0, 0.03), (None, 0.03), (0.03, None)])
def test_evaluated_distances_are_valid_until_the_bending_of_two_parts_uses_their_spare(bends):
    ends = np.array([[0.0, 1.0]])
    before, after = (None if x is None else BentParts(ends, np.array([[0.0, x]])) for x in bends)
    config, _ = moved()
    for share, is_valid in ((0.99, False), (1.01, True)):
        state = EvaluatedState(config, None, share * 0.06, (), before)
        assert state.holds(config, None, (), after) == is_valid


def dense_line(held, member):
    """Return 2,001 points of the bent centre line of a member [m]."""
    positions = np.linspace(0.0, held.config.member_lengths[member], 2001)
    return held.bent_lines(np.full(2001, member), positions)[0]


@pytest.fixture(scope='module', params=some_now(range(30), 4))
def bent(request):
    """Return a random grasp whose tubes are bent, the contacts, and a generator."""
    rng = np.random.default_rng(request.param)
    while True:
        config = NINE.configuration(rng.uniform(-0.06, 0.06, len(NINE.roller_names)))
        module, diameter = NINE.module_names[rng.integers(9)], rng.uniform(0.15, 0.35)
        try:
            center = core.tangent_center(config, module, diameter, rng.uniform(0.01, 0.03))
        except GraspError:
            continue
        settled = core.settle_grasp(config, core.ConvexObject.disc(center, diameter), 1.5)
        if settled.held:
            return settled.equilibrium, settled.equilibrium.touching(1.5), rng


def test_distance_of_a_bent_tube_from_an_obstacle_is_that_of_its_centre_line(bent):
    held, grip, rng = bent
    radius = 0.5 * NINE.description.tube_diameter
    for member in (*held.members.tolist(), rng.integers(9)):
        line, topology = dense_line(held, member), NINE.topology
        start, axis = held.config.points[topology.b[member]], held.config.member_axes[member]
        across = ((line - start) * axis.conj()).imag
        most = int(np.abs(across).argmax())
        size = rng.uniform(0.02, 0.1)
        # 20 mm beside the straight tube, where it bends most.
        away = 1j * axis * np.sign(across[most]) * (radius + 0.02 + size)
        center = start + (axis.conj() * (line[most] - start)).real * axis + away
        pose = center.real, center.imag, np.angle(axis)
        shape = rng.choice([core.Disc(2.0 * size), core.Polygon(size * SQUARE)])
        post = core.Obstacle('post', core.ConvexObject(shape, pose))
        barrier = ObstacleBarrier(NINE, ALL, [post], needs_object=False)
        wanted = post.body.nearest(line).gaps.min() - radius
        assert barrier.values(held.config, grip, [member]) == pytest.approx(wanted, abs=5e-4)
        assert wanted < 0.02


def test_distances_of_the_object_from_other_members_are_those_of_bent_tubes(bent):
    held, grip, _ = bent
    radius = 0.5 * NINE.description.tube_diameter
    others = [member for member in range(9) if member not in held.members]
    wanted = [held.body.nearest(dense_line(held, i)).gaps.min() - radius for i in others]
    values = ObjectBarrier(NINE, ALL).values(held.config, grip, others)
    assert values == pytest.approx(wanted, abs=5e-4)


def test_distances_between_parts_are_those_of_the_bent_robot(bent):
    held, grip, _ = bent
    barrier, nodes = SelfCollisionBarrier(NINE, ALL), NINE.topology
    radius, spread = 0.5 * NINE.description.tube_diameter, NINE.description.module.pinch_separation
    names = barrier.names(np.arange(len(barrier.values(held.config, grip, ALL_VALUES))))
    middles = {
        f'module {name}': 0.5 * (dense_line(held, i)[0] + dense_line(held, nodes.previous[i])[-1])
        for i, name in enumerate(NINE.module_names)
    }
    lines = {f'member {name}': dense_line(held, i) for i, name in enumerate(NINE.member_names)}
    compared = 0
    for i, name in enumerate(names):
        module, _, member = name.partition(' and ')
        if module in middles and member in lines:
            wanted = np.abs(lines[member] - middles[module]).min() - 2.0 * radius - 0.5 * spread
            value = barrier.values(held.config, grip, [i])
            assert value == pytest.approx(wanted, abs=5e-4)
            compared += 1
    assert compared > 9


@robots.examples(100)
@given(robots.generators())
def test_a_motion_ends_where_a_margin_reaches_its_bound(rng):
    """A parabola through the margins at both ends, with the slope of the row, models a margin."""
    size, duration = 10.0 ** rng.uniform(-6.0, 0.0), rng.uniform(0.01, 0.1)
    law, (speed, travel) = BarrierLaw(0.5, size), size * rng.standard_normal(2)
    slopes, middle = rng.standard_normal(3), size * rng.uniform(0.1, 2.0, 3)
    start = middle - 0.5 * duration * speed * slopes
    end = start - size * rng.uniform(-0.5, 2.0, 3)
    assume(start.min() > 0.0)
    barrier = SimpleNamespace(law=law, status=1, values=lambda *_: 0.5 + end, names=np.array)
    active = ActiveValues(np.arange(3), 0.5 + middle, np.zeros((3, 0)))
    limit = BarrierLimit(barrier, active, slopes[:, None])
    violation = limit.violation(None, None, np.array([travel]), np.array([speed]), duration)
    bound = law.discrete_bound(start, duration, max(abs(travel), duration * abs(speed)))
    if violation is None:
        assert (end >= bound).all()
        return
    assert violation.names == tuple(np.flatnonzero(end < bound))

    def excess(share):
        curvature = end - start - slopes * travel
        return ((start + slopes * travel * share + curvature * share**2 - bound) / size)[
            end < bound
        ]

    assert excess(violation.share).min() == pytest.approx(0.0, abs=1e-9)
    assert min(excess(share * violation.share).min() for share in np.linspace(0, 1, 20)) > -1e-9


@pytest.mark.parametrize(
    ('travel', 'speed', 'is_violated'), [(1e-2, 0.0, False), (0.0, 1.0, False), (1e-3, 0.1, True)]
)
def test_second_order_effects_are_those_of_this_or_the_previous_sample(travel, speed, is_violated):
    law = BarrierLaw(0.5, 0.2)
    barrier = SimpleNamespace(law=law, status=1, values=lambda *_: np.array([0.495]), names=list)
    active = ActiveValues(np.array([0]), np.array([0.5]), np.zeros((1, 0)))
    limit = BarrierLimit(barrier, active, np.zeros((1, 1)))
    violation = limit.violation(None, None, np.array([travel]), np.array([speed]), 0.01)
    assert (violation is not None) is is_violated


@pytest.mark.parametrize('share', [0.02, 0.1, 0.5, 0.9, 1.0])
def test_margins_fall_by_the_class_k_function(share):
    """The function of docs/safety.md, for the margin less a hundredth of the band."""
    margin = share * 0.2 - 0.01 * 0.2
    expected = 5.0 * margin / (1.0 - margin / 0.2)
    law = BarrierLaw(bound=0.3, band=0.2)
    assert law.class_k_bound(np.array([share * 0.2])) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize('travel', [0.0, 1e-4, 1e-3])
def test_a_margin_beyond_its_bound_decreases_by_the_square_of_the_travel(travel):
    law = BarrierLaw(bound=0.3, band=0.2)
    for margin in (0.09 * law.safety_margin, 0.0, -0.1):
        left = law.discrete_bound(np.array([margin]), 0.01, travel)[0]
        assert margin - left == pytest.approx(1e-9 + 0.2 * (travel / 0.05) ** 2, rel=0.01)


def test_a_positive_margin_stays_positive_in_samples_of_large_travel():
    law = BarrierLaw(bound=0.3, band=0.2)
    margins = np.array([1e-3, 0.09, 0.009]) * law.safety_margin
    for _ in range(100):
        left = law.discrete_bound(margins, 0.01, 0.05)
        assert (left <= margins).all()
        margins = left
    assert margins.min() > 0.0


@robots.examples(50)
@given(robots.generators())
def test_law_leads_to_the_safety_margin_and_no_further(rng):
    law = BarrierLaw(rng.uniform(0.0, 1.0), rng.uniform(0.01, 1.0), rng.uniform(0.5, 20.0))
    margins = rng.uniform(-1.0, 2.0, 50) * law.band
    bound = law.class_k_bound(margins)
    assert (bound >= 0.0).all()
    assert (bound[margins <= law.safety_margin] == 0.0).all()
    assert np.isinf(bound[margins > law.band + law.safety_margin]).all()
    # The closer, the slower.
    assert (np.diff(np.minimum(bound, 1e9)[np.argsort(margins)]) >= 0.0).all()
    h, dt = 0.9 * law.band, 0.1 / law.rate
    for _ in range(1000):
        h = max(h - dt * law.class_k_bound(np.array([h]))[0], -1.0)
        assert h > 0.0
    assert h == pytest.approx(law.safety_margin, rel=1e-3)


@pytest.mark.parametrize('first', range(9))
def test_distances_leave_out_grasping_members_their_module_and_the_rods_at_its_joint(first):
    config = core.load_robot('nine_member').home
    topology = config.robot.topology
    meeting = topology.following[first]
    members = tuple(topology.member_names[i] for i in (first, meeting))
    rods = np.flatnonzero(topology.joint == topology.joint[meeting])
    count = topology.n_modules
    expected = {first, meeting, count + meeting, *(2 * count + rods)}

    distances = object_distances(config, core.ConvexObject.disc((0.0, 0.0), 0.2), members)

    assert set(np.flatnonzero(np.isinf(distances))) == expected


GRIP = box_between()


def test_a_command_ends_before_a_contact_is_lost():
    watch = core.ShapeGuard(NINE, ShapeBounds(0.0, 0.0, 0.0, 1e-6, 1e-6)).watch(NINE.home, GRIP)
    away = np.array([0.25, -0.3, 0.3, 0.2, -0.3, 0.25])
    command = RollerCommand(away, np.array([0.1, 0.2, 0.3]), 1.0, core.Status.OK)
    kept = watch.keep(command, np.zeros(len(away)), 1.0)
    assert kept.status is core.Status.SLOWED_OBJECT
    assert kept.limiting == ('the contacts of the grip',)
    assert 0.0 < kept.scale <= 0.4
    there = NINE.home.moved_to(kept.roller_velocities)
    body = core.RollingGrip.attach(NINE.home, GRIP).moved_to(there).grip.body
    assert object_distances(there, body, GRIP.members).min() >= 0.0


def test_a_shape_on_a_line_is_not_rigid():
    robot = core.load_robot('triangle')
    flat = core.Configuration(robot, np.zeros(2), robot.home.points.real + 0j)
    assert shape_margins(flat).rigidity == 0.0


PERIOD = 0.02
TRAVEL = np.array([3e-3, -4e-3])


def grasp(used):
    """Return a stand-in of an equilibrium with a utilisation of its second member."""
    robot = SimpleNamespace(member_names=('P-Q', 'Q-R'))
    config = SimpleNamespace(roller_positions=np.zeros(2), robot=robot)
    return SimpleNamespace(config=config, sections=SimpleNamespace(used=np.array([0.1, used])))


def limited(usage, way, most):
    """Return the command of a way (2,) in one period under a bound of the utilisation."""
    command = RollerCommand(way / PERIOD, np.zeros(3), 1.0, core.Status.OK)
    return usage.limit_utilisation(command, PERIOD, most)


def test_utilisation_uses_five_times_its_distance_per_second_at_most():
    usage = UsageLimits.of(grasp(0.5)).learned(grasp(0.7), 0.0, TRAVEL)
    command = limited(usage, TRAVEL, 1.0)
    # The same travel adds 0.2, but for the regularisation.
    assert command.scale == pytest.approx(5.0 * PERIOD * 0.3 / 0.2, rel=1e-3)
    assert (command.status, command.limiting) == (core.Status.SLOWED_UTILISATION, ('member Q-R',))


def test_utilisation_beyond_its_bound_may_only_fall():
    usage = UsageLimits.of(grasp(0.5)).learned(grasp(0.7), 0.0, TRAVEL)
    assert limited(usage, TRAVEL, 0.6).scale == 0.0
    assert limited(usage, -TRAVEL, 0.6).scale == 1.0


def share(usage, way, free=1.0):
    """Return the share of a way (2,) in one period by the slip margin of which `free` is free."""
    return usage.margin_share(RollerCommand(way / PERIOD, None, 1.0, core.Status.OK), PERIOD, free)


def test_slip_margin_decays_at_most_at_two_per_second():
    usage = UsageLimits.of(grasp(0.5)).learned(grasp(0.5), -0.1, TRAVEL)
    # As much as the last travel used, of 0.04 N.
    assert share(usage, TRAVEL) == pytest.approx(0.4, rel=1e-3)
    assert share(usage, TRAVEL, 0.5) == pytest.approx(0.2, rel=1e-3)
    assert share(usage, TRAVEL, -1.0) == 0.0
    assert share(usage, -TRAVEL) == 1.0


def test_effects_of_perpendicular_travels_are_learned_independently():
    usage, across = UsageLimits.of(grasp(0.5)), np.array([4e-3, 3e-3])
    usage = usage.learned(grasp(0.6), -0.1, TRAVEL).learned(grasp(0.8), -0.2, across)
    assert share(usage, TRAVEL) == pytest.approx(0.4, rel=1e-3)
    assert share(usage, across) == pytest.approx(0.2, rel=1e-3)
    # At most 5 times the distance of 0.2 in a second.
    assert limited(usage, TRAVEL, 1.0).scale == pytest.approx(0.1 * 0.2 / 0.1, rel=1e-3)
    assert limited(usage, across, 1.0).scale == pytest.approx(0.1 * 0.2 / 0.2, rel=1e-3)
    # What is known is not learned again.
    usage = usage.rolled(TRAVEL).learned(grasp(0.9), 0.0, TRAVEL)
    assert share(usage, TRAVEL) == pytest.approx(0.4, rel=1e-3)


#: So wide that everything is near.
ROBOT = core.load_robot('nine_member')
BOUND = 0.02
HELD = held_at(ROBOT.home, 'north/Z', 0.3)
AHEAD = core.Obstacle('post', core.ConvexObject.disc((HELD.pose.x, HELD.pose.y - 0.45), 0.2))


@pytest.mark.parametrize('needs_object', [False, True])
@robots.examples(12)
@given(rng=robots.generators())
def test_obstacle_barrier_keeps_the_contract_of_barriers(needs_object, rng):
    room = random_room(rng, HELD, wall=True)
    barrier = ObstacleBarrier(ROBOT, ALL, room, needs_object)
    check_barrier(barrier, HELD.config, HELD.grip, rng)


def test_drift_is_the_rate_of_the_distances_from_moving_obstacles():
    rng, step = np.random.default_rng(4), 1e-6
    room = [
        replace(obstacle, velocity=(*rng.uniform(-0.3, 0.3, 2), 0.5), stamp=0.0)
        for obstacle in random_room(rng, HELD, 5)
    ]
    for needs_object in (False, True):
        barrier = ObstacleBarrier(ROBOT, ALL, room, needs_object)
        near = barrier.active(HELD.config, HELD.grip)
        ahead, behind = (
            ObstacleBarrier(ROBOT, ALL, [o.at(time) for o in room], needs_object).values(
                HELD.config, HELD.grip, near.indices
            )
            for time in (step, -step)
        )
        assert near.drift == pytest.approx((ahead - behind) / (2.0 * step), abs=1e-4)


def test_active_values_depend_on_the_present_state_and_obstacles_alone():
    rng, law = np.random.default_rng(7), BarrierLaw(0.02, 0.1)
    room = random_room(rng, HELD, 6)
    moving = [replace(room.pop(), velocity=(0.1, 0.2, 0.0), stamp=0.0) for _ in range(2)]
    old = ObstacleBarrier(ROBOT, law, room, needs_object=False)
    config, count = ROBOT.home, 0
    way = rng.uniform(-1.0, 1.0, len(ROBOT.roller_names))
    for step in range(60):
        now = 0.01 * step
        config = ROBOT.home.moved_to(0.1 * np.sin(now) * way)
        there = [obstacle.at(now) for obstacle in moving]
        near = old.with_moving(there).active(config, None)
        fresh = ObstacleBarrier(ROBOT, law, [*room, *there], False).active(config, None)
        assert near.indices.tolist() == fresh.indices.tolist()
        assert near.values == pytest.approx(fresh.values, abs=1e-12)
        count += len(near.indices)
    assert count


def test_active_values_follow_an_obstacle_that_turns_in_place():
    beam = core.Polygon(((-0.4, -0.02), (0.4, -0.02), (0.4, 0.02), (-0.4, 0.02)))
    body = core.ConvexObject(beam, (HELD.pose.x, HELD.pose.y + 0.8, 0.0))
    law, counts = BarrierLaw(0.02, 0.1), set()
    turning = core.Obstacle('beam', body, (0.0, 0.0, 1.0), 0.0)
    old = ObstacleBarrier(ROBOT, law, [], needs_object=False)
    for now in np.linspace(0.0, 1.5, 40):
        there = [turning.at(now)]
        near = old.with_moving(there).active(ROBOT.home, None)
        fresh = ObstacleBarrier(ROBOT, law, there, False).active(ROBOT.home, None)
        assert near.indices.tolist() == fresh.indices.tolist()
        counts.add(len(near.indices))
    assert len(counts) > 1


def stand_ahead(held, rng):
    """Return a post near the object where no member is, and the unit vector toward it."""
    body, distance = held.grip.body, 0.05 + BOUND + 0.01
    for way in np.exp(1j * (rng.uniform(0.0, 2.0 * np.pi) + np.linspace(0.0, 2.0 * np.pi, 24))):
        place = body.center + (body.arm + distance) * way
        post = core.Obstacle('post', core.ConvexObject.disc((place.real, place.imag), 0.1))
        if clearance(held, [post]) > BOUND + 1e-3:
            return post, way
    assume(False)


@robots.examples(24)
@given(st.just(ROBOT) | robots.robots(), robots.generators(), st.booleans())
def test_clearance_from_obstacles_stays_above_its_bound(robot, rng, slide):
    try:
        held = held_at(robot.home, str(rng.choice(robot.module_names)), 0.2)
    except GraspError:
        assume(False)
    post, way = stand_ahead(held, rng)
    room = [post, *random_room(rng, held, 2, BOUND + 1e-3, wall=bool(rng.integers(2)))]
    walker, clearances = Driven(held, 0.01, slide_along_limits=slide, obstacles=tuple(room)), []
    for _ in range(50):
        twist = 0.15 * way.real, 0.15 * way.imag, 0.1 * rng.standard_normal()
        command = walker.step(twist)
        clearances.append(clearance(walker.held, room))
        assert clearances[-1] > BOUND - 1e-4
        if command.scale < 1e-3:
            assert command.limiting
    assume(min(clearances) < BOUND + 5e-3)


def test_object_comes_to_rest_before_an_obstacle_with_the_names_of_both():
    robot = Driven(HELD, 0.04, slide_along_limits=False, obstacles=(AHEAD,))
    for _ in range(100):
        command = robot.step((0.0, -0.08, 0.0))
    assert command.status is core.Status.SLOWED_OBSTACLE
    assert 'the object and obstacle post' in command.limiting
    assert clearance(robot.held, [AHEAD]) == pytest.approx(BOUND, abs=2e-3)


def test_object_slides_along_an_obstacle():
    box = core.Polygon(((-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)))
    x, y, _ = HELD.pose
    table = core.Obstacle('table', core.ConvexObject(box, (x, y - 0.3, 0.0)))
    moved = []
    for slide in (False, True):
        robot = Driven(HELD, 0.04, slide_along_limits=slide, obstacles=(table,))
        for _ in range(65):
            command = robot.step((0.03, -0.06, 0.0))
        moved.append(robot.held.pose.x - x)
        assert clearance(robot.held, [table]) > BOUND - 1e-4
    assert command.status is core.Status.SLIDING
    assert moved[1] > moved[0] + 0.02


@pytest.mark.parametrize('gap', [0.005, -0.02])
def test_start_too_near_an_obstacle_is_left_by_motion_away_only(gap):
    x, y, _ = HELD.pose
    post = core.Obstacle('post', core.ConvexObject.disc((x, y - 0.25 - gap), 0.2))
    robot = Driven(HELD, 0.02, slide_along_limits=False, obstacles=(post,))
    for _ in range(15):
        command = robot.step((0.0, -0.05, 0.0))
    assert command.status is core.Status.SLOWED_OBSTACLE
    assert clearance(robot.held, [post]) > gap - 1e-5
    for _ in range(50):
        command = robot.step((0.0, 0.05, 0.0))
    assert clearance(robot.held, [post]) > gap + 0.02
