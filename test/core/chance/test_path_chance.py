# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Chance along a path and of an interval of friction, and grasps that are ranked by it."""

from dataclasses import fields
from functools import cache

from carries import make_robot, place
from grips import gripped
from isotruss_ros import core
from isotruss_ros.core import settle_grasp, Uncertainty
from isotruss_ros.core.chance.criteria import find_criteria
from isotruss_ros.core.chance.probability import find_chance
from isotruss_ros.core.chance.random_inputs import changed_grip
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.held_gradient import GraspParameters
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.planning.foresee_path import foresee_path
from isotruss_ros.core.planning.grasp_plan import export_figures, plan_in_words
from nightly import some_now
import numpy as np
import pytest
import robots

HOME = core.load_robot('nine_member').home
FRICTION = 0.8
DISC = core.ConvexObject.disc((0.5, 0.3), 0.3)
UNCERTAIN = core.Uncertainty(stiffness=0.15, roller_offset=0.005, force=0.3)
CARRY = ((0.0, 0.0, 0.0), (0.02, 0.02, 0.05))


@cache
def carried(name='disc 0.2 m'):
    """Return the first, the middle and the last equilibrium along a short path."""
    body, members = place(make_robot(), name, 0.5)
    held = core.settle_grasp(HOME, body, FRICTION, members=members).equilibrium
    foresight = foresee_path(held, FRICTION, np.array(CARRY))
    assert foresight.why == ''
    return [foresight.grips[at] for at in (0, len(foresight.grips) // 2, -1)]


def rolled(passed, change):
    """Return the equilibria for changed parameters, at the nominal roller travel."""
    rollers = change[GraspParameters.of(HOME).rollers]
    grips = [changed_grip(passed[0], change)]
    for grip in passed[1:]:
        config = HOME.moved_to(grip.config.roller_positions + rollers)
        wrench = grips[0].wrench * (1.0, 1.0, grips[0].arm)
        grips.append(roll_grip(grips[-1], config, wrench))
    return grips


def at_rest(name):
    """Return the equilibrium of an object under a load, without a path."""
    body, members = place(make_robot(), name, 0.5)
    wrench = (0.3, -0.2, 0.01)
    return [core.settle_grasp(HOME, body, FRICTION, wrench, members=members).equilibrium]


#: Functions that return equilibria, with grasps and the accuracy of the rates.
EQUILIBRIA = [
    *((at_rest, name, 1e-4) for name in ('brick', 'box', 'three members')),
    *((carried, name, 2e-3) for name in ('disc 0.2 m', 'brick')),
    (at_rest, 'disc 0.2 m', 1e-4),
]


@pytest.mark.parametrize(('find', 'name', 'accuracy'), some_now(EQUILIBRIA, 4))
def test_rates_of_criteria_are_those_of_rolled_equilibria(find, name, accuracy):
    passed, columns = find(name), GraspParameters.of(HOME)
    ends = slice(None, None, max(len(passed) - 1, 1))
    first = len(find_criteria(passed[:1], FRICTION).names) if passed[1:] else 0
    criteria = find_criteria(passed[ends], FRICTION)
    is_near = [not text.startswith('contact with') for text in criteria.names]
    near = first + np.flatnonzero(is_near[first:])
    spread = np.maximum(np.sqrt(np.diag(UNCERTAIN.covariance(passed[0]))), 1e-3)
    for k, step in enumerate(2e-3 * spread):
        ahead, behind = (
            find_criteria(
                rolled(passed, way * step * np.eye(len(spread))[k])[ends],
                FRICTION + way * step * (k == columns.friction),
            ).values[near]
            for way in (1.0, -1.0)
        )
        errors = np.abs((ahead - behind) / (2.0 * step) - criteria.rates[near, k])
        # The dents of an object of another size are those of the given size.
        share = max(accuracy, 1e-3) if k == len(spread) - 1 else accuracy
        assert (
            errors * spread[k] <= share * np.maximum(np.abs(criteria.values[near]), 1e-3)
        ).all()


def test_a_longer_path_has_a_smaller_chance():
    passed = carried()
    friction = 0.05 + passed[0].required_friction
    covariance = UNCERTAIN.covariance(passed[0])
    chances = [find_chance(passed[:n], friction, covariance) for n in (1, len(passed))]
    assert chances[1].probability < chances[0].probability


@cache
def plan(carry=(), is_certain=True):
    """Return the grasps for the nominal or for an uncertain robot."""
    needs, uncertainty = core.GraspRequirements(carry=carry), None if is_certain else UNCERTAIN
    return core.plan_grasps(HOME, DISC, needs, max_rounds=1, uncertainty=uncertainty)


@pytest.fixture(params=[(), CARRY], ids=['grasp', 'carry'])
def plans(request):
    """Return the plans for the nominal and for the uncertain robot."""
    return plan(request.param), plan(request.param, is_certain=False)


def test_grasps_are_ranked_by_their_chance(plans):
    chances = [grasp.chance.probability for grasp in plans[1]]
    assert chances == sorted(chances, reverse=True)
    assert [grasp.score for grasp in plans[1]] == [g.chance.reliability for g in plans[1]]


def test_the_chance_of_planned_grasps_is_that_from_samples_unless_they_are_carried():
    grasps = plan(is_certain=False)
    best = grasps[0]
    settled = core.settle_grasp(best.config, best.grip.body, 0.5, members=best.members)
    assert best.chance == settled.chance(UNCERTAIN, samples=200)
    assert len(grasps) == 3
    assert {grasp.chance.method for grasp in plan(CARRY, is_certain=False)} == {'first order'}


def test_the_best_grasp_has_a_larger_chance_than_the_nominal_one(plans):
    grasp = plans[0][0]
    body = grasp.grip.body
    held = attach_grip(grasp.config, body, grasp.equilibrium.members)
    nominal = find_chance([held], 0.5, UNCERTAIN.covariance(held))
    assert plans[1][0].chance.reliability > nominal.reliability


def test_the_chance_is_stated_only_with_an_uncertainty(plans):
    assert 'held with a chance of 0.9' in plan_in_words(plans[1])
    assert export_figures(plans[1][0])['chance'] == plans[1][0].chance.probability
    assert 'chance' not in plan_in_words(plans[0])
    assert 'chance' not in export_figures(plans[0][0])


def test_the_chance_is_that_under_the_required_wrench():
    needs = core.GraspRequirements(external_wrench=(0.0, -1.0, 0.0), count=1)
    loaded = core.plan_grasps(HOME, DISC, needs, max_rounds=1, uncertainty=UNCERTAIN)
    assert loaded[0].chance.reliability < plan(is_certain=False)[0].chance.reliability


CONFIG, CYLINDER = gripped(40.0, squeeze=0.04)
SETTLED = settle_grasp(CONFIG, CYLINDER, 0.9)
REQUIRED = SETTLED.required_friction
ONLY_FRICTION = {
    field.name: 0.0
    for field in fields(Uncertainty)
    if field.name not in ('friction', 'offset_covariance')
}


def uncertain(smallest, largest):
    """Return an uncertainty of friction alone."""
    return Uncertainty(friction=(smallest, largest), **ONLY_FRICTION)


@pytest.mark.parametrize(
    ('below', 'above', 'share'),
    [(-0.2, -0.1, 0.0), (-0.2, 0.1, 1.0 / 3.0), (0.1, 0.2, 1.0), (0.1, 0.1, 1.0)],
)
def test_chance_from_samples_is_the_share_of_the_interval_that_suffices(below, above, share):
    uncertainty = uncertain(REQUIRED + below, REQUIRED + above)
    assert SETTLED.chance(uncertainty, samples=4).probability == pytest.approx(share, abs=1e-4)


def test_chance_to_first_order_has_the_mean_and_variance_of_the_interval():
    half_width = 3.0**0.5 * 0.05  # of a uniform distribution with a standard deviation of 0.05
    interval = uncertain(0.5 - half_width, 0.5 + half_width)
    normal = Uncertainty(friction=0.05, **ONLY_FRICTION)
    expected = settle_grasp(CONFIG, CYLINDER, 0.5).chance(normal, samples=0)
    assert SETTLED.chance(interval, samples=0).probability == pytest.approx(expected.probability)


def test_robot_file_states_the_interval_as_a_list():
    document = robots.preset_document('nine_member') | {'uncertainty': {'friction': [0.5, 0.8]}}
    assert Uncertainty.of(robots.load(document)).friction == (0.5, 0.8)


@pytest.mark.parametrize(
    ('interval', 'verdict'),
    [((-0.2, -0.01), 'lost'), ((-0.2, 0.1), 'unknown'), ((0.01, 0.1), 'held')],
)
def test_verdict_of_an_interval_holds_for_all_of_its_coefficients(interval, verdict):
    smallest, largest = interval
    friction = REQUIRED + smallest, REQUIRED + largest
    assert SETTLED.friction_range.verdict(friction) == verdict
