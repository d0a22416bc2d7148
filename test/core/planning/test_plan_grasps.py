# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Planned grasps, against equilibria and geometry computed otherwise."""

from concurrent.futures import Future
import itertools

from isotruss_ros import core
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.planning.foresee_path import foresee_grip
from isotruss_ros.core.planning.requirements import Measure
from isotruss_ros.core.planning.violations import violation_in_words
from isotruss_ros.core.safety.margins import object_distances, shape_margins
from nightly import some_now
import numpy as np
import pytest
from robots import preset
from scipy.optimize import bisect

ROBOT = preset('nine_member')
NORTH = 'north/R-P', 'north/P-Z'
OBJECTS = {
    'north': core.ConvexObject.disc((0.716, 0.5), 0.3),
    'south': core.ConvexObject.disc((0.05, -0.8), 0.3),
}
BRICK = core.ConvexObject(
    core.Polygon([(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)], corner_radius=0.02),
    core.Pose(0.716, 0.43, 0.2),
)
NEEDS = core.GraspRequirements(min_slip_margin=0.5, count=2)
#: Criteria of ranking; the fixture `plans` has the last one.
MEASURES = Measure.STIFFNESS, Measure.TOTAL_FORCE, Measure.TRAVEL, Measure.SLIP_MARGIN


@pytest.fixture(scope='module')
def plans():
    """Plan grasps of all objects once."""
    return {
        name: core.plan_grasps(ROBOT.home, one, NEEDS, thorough=False)
        for name, one in OBJECTS.items()
    }


def all_grasps(plans):
    return [(OBJECTS[name], grasp) for name, plan in plans.items() for grasp in plan]


def along(path, pieces=3):
    """Return configurations on a path, and the row from which each comes."""
    config = ROBOT.home.moved_to(path[0])
    yield 0, config
    for row, (begin, end) in enumerate(itertools.pairwise(path)):
        for share in np.linspace(0.0, 1.0, pieces + 1)[1:]:
            config = config.moved_to(begin + share * (end - begin))
            yield row + (share == 1.0), config


def test_every_loop_has_grasps(plans):
    for plan in plans.values():
        assert len(plan) == 2
        assert plan[0].score >= plan[1].score
        assert [grasp.score for grasp in plan] == [grasp.slip_margin for grasp in plan]
        assert plan.complete
        assert plan.closest_violation is None
        assert 0 < plan.analyses < plan.evaluations


def test_grasps_hold_by_their_roller_positions_alone(plans):
    for body, grasp in all_grasps(plans):
        config = preset('nine_member').configuration(grasp.path[-1])
        settled = core.settle_grasp(config, grasp.grip.body, NEEDS.friction, members=grasp.members)
        assert settled.held
        forces = settled.normal_forces.values()
        assert settled.slip_margin >= NEEDS.min_slip_margin - 1e-3
        assert grasp.slip_margin == pytest.approx(settled.slip_margin, rel=1e-3)
        assert grasp.total_force == pytest.approx(sum(forces), rel=1e-3)
        assert grasp.max_contact_force == pytest.approx(max(forces), rel=1e-3)
        assert grasp.utilisation == pytest.approx(max(settled.utilisation.values()), rel=1e-3)
        assert grasp.utilisation <= NEEDS.max_utilisation
        assert set(grasp.members) <= set(ROBOT.member_names)
        # Free, and closed in place.
        assert grasp.grip.body.shape == body.shape
        assert grasp.grip.body.pose[:2] == pytest.approx(body.pose[:2], abs=5e-3)
        assert abs(grasp.grip.body.pose.angle) < 0.06


def test_nothing_touches_before_the_touch_and_then_the_grip_alone_presses(plans):
    for body, grasp in all_grasps(plans):
        assert grasp.path[0] == pytest.approx(ROBOT.home.roller_positions)
        assert np.abs(grasp.path[-1] - grasp.config.roller_positions).max() == 0.0
        sides = [ROBOT.member_names.index(name) for name in grasp.members]
        before = np.zeros(len(sides))
        for row, config in along(grasp.path):
            gaps = -member_depths(config, body)
            assert np.delete(gaps, sides).min() > 0.0
            if row < grasp.touch:
                assert gaps.min() > -1e-6, row
            else:
                assert (gaps[sides] <= before + 1e-4).all()
                before = gaps[sides]
        at_touch = member_depths(ROBOT.home.moved_to(grasp.path[grasp.touch]), body)[sides]
        assert np.abs(at_touch).max() < 1e-6


def test_the_way_stays_within_all_bounds(plans):
    file = ROBOT.description
    for _, grasp in all_grasps(plans):
        least = np.inf
        for _, config in along(grasp.path):
            margins = shape_margins(config)
            assert margins.clearance > 0.0
            assert file.min_length <= config.member_lengths.min()
            assert config.member_lengths.max() <= file.max_length
            least = min(least, margins.rigidity)
        assert least >= NEEDS.min_rigidity - 1e-3
        assert grasp.rigidity == pytest.approx(least, abs=0.02)
        ways = np.abs(np.diff(grasp.path, axis=0)).sum(axis=0)
        assert grasp.travel == pytest.approx(ways.max())


@pytest.mark.parametrize('measure', some_now(MEASURES))
def test_best_comes_first_by_every_measure(measure):
    along = np.array([1.0, 2.0, 0.5])
    unit = along / np.linalg.norm(along)
    needs = core.GraspRequirements(measure=measure, direction=tuple(along), count=3)
    plan = core.plan_grasps(ROBOT.home, OBJECTS['north'], needs)
    scores = [grasp.score for grasp in plan]
    assert scores == sorted(scores, reverse=True)
    for grasp in plan:
        value = {
            Measure.SLIP_MARGIN: grasp.slip_margin,
            Measure.TOTAL_FORCE: -grasp.total_force,
            Measure.TRAVEL: -grasp.travel,
            Measure.STIFFNESS: unit @ grasp.equilibrium.response.stiffness @ unit,
        }[measure]
        assert grasp.score == pytest.approx(value, rel=1e-9)
        assert (grasp.path[-1] == grasp.equilibrium.config.roller_positions).all()


def test_external_wrench_is_held():
    needs = core.GraspRequirements(external_wrench=(1.0, -2.0, 0.0), count=1)
    plan = core.plan_grasps(ROBOT.home, OBJECTS['north'], needs, thorough=False)
    settled = core.settle_grasp(plan[0].config, OBJECTS['north'], 0.5, needs.external_wrench)
    assert settled.held
    assert plan[0].slip_margin == pytest.approx(settled.slip_margin, rel=0.05)


@pytest.mark.parametrize(
    ('body', 'needs', 'missed'),
    [
        (core.ConvexObject.disc((0.5, 3.0), 0.3), {}, 'enclosed'),
        (core.ConvexObject.disc((0.5, 0.4), 0.9), {}, 'free'),
        (OBJECTS['north'], {'module': 'south/P'}, 'members'),
        (OBJECTS['north'], {'max_total_force': 1e-3}, 'max_total_force'),
        (OBJECTS['north'], {'min_slip_margin': 1e3, 'max_utilisation': np.inf}, 'min_slip_margin'),
        (OBJECTS['north'], {'max_utilisation': 1e-4}, 'max_utilisation'),
    ],
)
def test_a_plan_without_grasps_has_the_closest_violation(body, needs, missed):
    needs = core.GraspRequirements(module=needs.pop('module', 'north/Z'), **needs)
    reports = []
    plan = core.plan_grasps(
        ROBOT.home, body, needs, on_progress=reports.append, should_stop=lambda: len(reports) > 2
    )
    assert not plan
    miss = plan.closest_violation
    assert miss.requirement == missed
    if missed in ('max_total_force', 'min_slip_margin', 'max_utilisation'):
        assert miss.bound == getattr(needs, missed)
    if missed == 'enclosed':
        assert (miss.value, miss.bound) == (0.0, 1.0)
    if missed == 'free':
        assert miss.value == pytest.approx(-member_depths(ROBOT.home, body).max(), abs=1e-4)
        assert miss.bound == pytest.approx(-0.02 * 0.102)
        assert 'move the object away from the robot' in violation_in_words(miss)


def test_an_invalid_module_or_seed_is_refused():
    with pytest.raises(GraspError, match='north/Q'):
        core.plan_grasps(ROBOT.home, OBJECTS['north'], core.GraspRequirements(module='north/Q'))
    for seed in (-1, 0.5, True):
        with pytest.raises(GraspError, match='seed'):
            core.plan_grasps(ROBOT.home, OBJECTS['north'], NEEDS, seed=seed)


def test_a_search_that_waits_for_an_executor_stops_on_request():
    futures, asked = [], []

    class Executor:
        def submit(self, *_):  # noqa: CNL100
            futures.append(Future())
            return futures[-1]

    def should_stop():
        asked.append(len(futures))
        return asked.count(asked[-1]) > 2 and bool(futures)  # after it has waited twice

    plan = core.plan_grasps(
        ROBOT.home, OBJECTS['north'], NEEDS, executor=Executor(), should_stop=should_stop
    )
    assert not plan.complete
    assert plan.grasps == ()
    assert all(future.cancelled() for future in futures)


@pytest.mark.parametrize(('angle', 'is_carried'), some_now([(0.15, True), (2.5, False)]))
def test_a_grasp_carries_the_object_along_the_required_path(angle, is_carried):
    path = ((0.0, 0.0, 0.0), (0.0, 0.0, angle))
    needs = core.GraspRequirements(module='north/P', friction=0.6, count=1, carry=path)
    plan = core.plan_grasps(ROBOT.home, BRICK, needs, max_rounds=1, thorough=False)
    if is_carried:
        grasp = plan[0]
        ahead = foresee_grip(grasp.config, grasp.grip.body, 0.6, np.array(path))
        assert (ahead.share, ahead.why) == (1.0, '')
    else:
        assert not plan.grasps
        words = violation_in_words(plan.closest_violation)
        assert words.startswith('carry: the object slips or is out of reach after')


@pytest.mark.parametrize('gap', [-0.0002, -0.0015])
def test_an_object_that_touches_a_member_is_freed_before_it_is_gripped(gap):
    home = ROBOT.home
    body = core.place_between(home, NORTH, core.Disc(0.3), indentation=-0.03).body
    x, y, _ = body.pose

    def lay(shift):
        return body.moved_to((x, y - shift, 0.0))

    shift = bisect(lambda shift: object_distances(home, lay(shift)).min() - gap, 0.0, 1.0)
    body = lay(shift)
    plan = core.plan_grasps(home, body, core.GraspRequirements(squeeze=15.0, friction=0.8))
    gaps = [
        object_distances(ROBOT.configuration(positions), body).min()
        for positions in plan[0].path[: plan[0].touch]
    ]
    assert min(gaps) > gap - 1e-5
    assert max(gaps) > 0.0
