# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Chance that an object is held, by exact equilibria and differences, and grasps ranked by it."""

from dataclasses import replace
from functools import cache, partial
from itertools import product
from pathlib import Path

from carries import make_robot, place
from grips import gripped
from held_grips import APART, BOX, CORNER, HOME
from isotruss_ros import core
from isotruss_ros.core.chance.criteria import find_criteria
from isotruss_ros.core.chance.probability import failure_probability, find_chance
from isotruss_ros.core.chance.random_inputs import changed_grip, sample_friction
from isotruss_ros.core.errors import GraspError, ObjectFileError, RobotFileError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.grasp_gradient import GraspParameters
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.planning.foresee_path import foresee_path
from isotruss_ros.core.planning.grasp_plan import export_figures, plan_in_words
from nightly import some_now
import numpy as np
import pytest
import robots
from scipy.stats import multivariate_normal, norm

#: The robot after calibration, with a disc whose size and pose are known well.
CALIBRATED = core.Uncertainty(stiffness=0.1, roller_offset=0.002, friction=0.08)
PULL = (0.5, -0.4, 0.01)
#: Parameters without deviations.
CERTAIN = core.Uncertainty(
    **dict.fromkeys(core.Uncertainty.__dataclass_fields__, 0.0) | {'offset_covariance': None}
)


def settle(friction=0.8, wrench=PULL, depth=0.02, diameter=0.3):
    """Return a disc in a corner of the robot at home."""
    x, y = core.tangent_center(HOME, 'north/Z', diameter)
    body = core.ConvexObject.disc((x + 0.002, y + depth), diameter)
    return core.settle_grasp(HOME, body, friction, wrench, members=CORNER)


def settle_afresh(settled, change):
    """Return a disc's grasp with changes of all parameters, by robot file and `settle_grasp`."""
    parameters = core.grasp_gradient(settled).parameters
    inputs = (settled.equilibrium or settled.lost).inputs
    given, stiffness = inputs.body, 1.0 + change[parameters.stiffness]
    disc = core.Disc(given.shape.diameter * (1.0 + change[-1]))
    robot = core.Robot(replace(HOME.robot.description, stiffness_scale=stiffness))
    return core.settle_grasp(
        robot.home.moved_to(inputs.config.roller_positions + change[parameters.rollers]),
        core.ConvexObject(disc, np.add(given.pose, change[parameters.place])),
        max(settled.friction + change[parameters.friction], 0.0),
        inputs.wrench + change[parameters.wrench],
        pressure=inputs.pressures + change[parameters.pressures],
        members=CORNER,
    )


def share_held(settled, uncertainty, count):
    """Return the share of own draws in which the disc is held, and its standard error."""
    covariance = uncertainty.covariance(settled.equilibrium or settled.lost)
    changes = np.random.default_rng(0).multivariate_normal(np.zeros(18), covariance, count)
    held = [settle_afresh(settled, change).held for change in changes]
    return np.mean(held), np.std(held) / np.sqrt(count)


@pytest.mark.parametrize('sigmas', [(0.75, 1.2), (-0.5, 1.2)])
@pytest.mark.parametrize('correlation', [-0.9, 0.0, 0.7, 1.0])
def test_probability_of_two_violations_is_exact(correlation, sigmas):
    matrix, sigmas = np.array([[1.0, correlation], [correlation, 1.0]]), np.array(sigmas)
    both = multivariate_normal(cov=matrix, allow_singular=True).cdf(sigmas)
    assert failure_probability(sigmas, matrix) == pytest.approx(1.0 - both, abs=1e-7)


def test_repeated_violations_count_once():
    failure = failure_probability(np.full(4, 1.2), np.ones((4, 4)))
    assert failure == pytest.approx(norm.sf(1.2), abs=1e-6)


@pytest.mark.parametrize('seed', range(5))
def test_probability_is_bounded_for_many_violations(seed):
    rng = np.random.default_rng(seed)
    axes, sigmas = rng.standard_normal((5, 6)), np.sort(rng.uniform(0.0, 2.0, 5))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    failure = failure_probability(sigmas, axes @ axes.T)
    draws = rng.standard_normal((100_000, 6)) @ axes.T + sigmas
    frequency = 1.0 - (draws > 0.0).all(axis=1).mean()
    assert frequency - 0.005 <= failure <= 1.0
    assert failure >= (draws <= 0.0).mean(axis=0).max() - 0.005


#: Arguments of `settle`, and uncertainty. Beside a utilisation of 1, the pressures decide.
UNLOADED = {'friction': 1.2, 'wrench': (0.0, 0.0, 0.0)}
UNCERTAIN = [
    ({'friction': 0.62}, CALIBRATED),
    (UNLOADED | {'depth': 0.0454}, replace(CERTAIN, pressure=0.05)),  # utilisation 0.985
    (UNLOADED | {'depth': 0.0468}, replace(CERTAIN, pressure=0.05)),  # utilisation 1.015
    (UNLOADED | {'depth': 0.0454}, replace(CERTAIN, size=0.03)),
    (UNLOADED | {'depth': -0.001}, replace(CERTAIN, position=0.003)),  # no contact
    ({'friction': 0.65}, core.Uncertainty()),
    ({'friction': 0.8}, core.Uncertainty(stiffness=0.5)),
]


@pytest.mark.parametrize(('grasp', 'uncertainty'), some_now(UNCERTAIN))
def test_chance_is_the_frequency_of_held_draws(grasp, uncertainty):
    settled = settle(**grasp)
    share, error = share_held(settled, uncertainty, 80)
    chance = settled.chance(uncertainty)
    assert 0.05 < chance.probability < 0.99
    assert abs(chance.probability - share) <= 2.5 * np.hypot(error, chance.standard_error)


def test_samples_agree_with_first_order_and_repeat():
    settled, shares = settle(0.66), []
    exact = settled.chance(CALIBRATED, samples=0)
    assert np.isnan(exact.standard_error)
    drawn = settled.chance(CALIBRATED, samples=40, seed=1, on_progress=shares.append)
    assert 0.015 < drawn.standard_error < 0.035
    tolerance = 0.02 + 3.0 * drawn.standard_error
    assert drawn.probability == pytest.approx(exact.probability, abs=tolerance)
    assert shares == [1.0]
    assert settled.chance(CALIBRATED, samples=40, seed=1) == drawn


def settle_box():
    body = core.place_between(HOME, APART, BOX, 0.4, 0.01).body
    return core.settle_grasp(HOME, body, 0.9, members=APART)


@pytest.mark.parametrize(
    ('settled', 'deviations', 'method'),
    [
        (partial(settle, 0.66), {'friction': 0.08, 'stiffness': 0.02}, 'first order'),
        # Two deviations of the zeros open a contact; so does the pose.
        (partial(settle, wrench=np.zeros(3), depth=0.01), {'roller_offset': 0.01}, 'samples'),
        (partial(settle, wrench=np.zeros(3), depth=0.005), {'position': 0.003}, 'samples'),
        (settle_box, {'friction': 0.01}, 'samples'),
    ],
)
def test_first_order_is_the_default_unless_contacts_may_be_lost_or_roll_over_corners(
    settled, deviations, method
):
    chance = settled().chance(replace(CERTAIN, **deviations))
    assert chance.method == method
    assert chance.standard_error <= (0.02 if method == 'first order' else 0.04)


def test_one_uncertain_quantity_has_the_whole_share_and_its_normal_distribution():
    settled = settle()
    chance = settled.chance(replace(CERTAIN, friction=0.1))
    assert chance.limit.startswith('slip at north/')
    assert next(iter(chance.shares.items())) == ('friction', pytest.approx(1.0))
    sigmas = (settled.friction - settled.required_friction) / 0.1
    assert chance.reliability == pytest.approx(sigmas)


def test_the_weakest_equilibrium_of_a_path_limits_its_chance():
    firm, weak = (settle(depth=depth).equilibrium for depth in (0.03, 0.012))
    assert weak.sections.used.max() < firm.sections.used.max()
    covariance = CALIBRATED.covariance(firm)
    paths = [firm, firm, firm], [firm, weak, firm]
    steady, shallow = (find_chance(grips, 0.8, covariance).reliability for grips in paths)
    assert shallow < steady - 0.01


def test_samples_without_a_configuration_are_left_out():
    # Beyond 0.3 m to 0.6 m of travel of this roller, either way, there is no configuration.
    covariance = np.diag(np.eye(18)[HOME.robot.roller_names.index('east/Q')])
    required = sample_friction(settle().equilibrium.inputs, covariance, 40, 0)
    assert 5 < len(required) < 30


def test_samples_without_an_equilibrium_are_not_held():
    grip = settle().equilibrium
    covariance = 100.0 * replace(CERTAIN, force=100.0).covariance(grip)
    required = sample_friction(grip.inputs, covariance, 10, 0)
    assert len(required) == 10
    assert np.isinf(required).mean() > 0.8


def test_an_object_of_another_size_has_the_same_centroid():
    corners = [(0.0, 0.0), (0.3, 0.0), (0.3, 0.2), (0.0, 0.2)]
    body = core.ConvexObject(core.Polygon(corners), (0.7, 0.5, 0.3))
    larger = body.scaled(1.1)
    assert larger.middle == pytest.approx(body.middle)
    assert larger.shape.perimeter == pytest.approx(1.1 * body.shape.perimeter)


def test_pressures_deviate_by_a_share_and_the_wrench_by_the_mass():
    grip = settle().equilibrium
    covariance = replace(CERTAIN, pressure=0.05, mass=0.2).covariance(grip)
    columns = core.grasp_gradient(settle()).parameters
    pressures, wrench = columns.pressures, columns.wrench
    shares = np.diag(np.square(0.05 * np.array(grip.inputs.pressures)))
    assert covariance[pressures, pressures] == pytest.approx(shares)
    assert covariance[wrench, wrench] == pytest.approx(0.04 * np.outer(PULL, PULL))


@pytest.mark.parametrize(('friction', 'probability'), [(0.8, 1.0), (0.2, 0.0)])
def test_without_deviations_the_chance_is_one_or_zero(friction, probability):
    first, drawn = (settle(friction).chance(CERTAIN, samples=n) for n in (None, 10))
    assert first.probability == drawn.probability == probability
    assert set(first.shares.values()) == {0.0}
    # Samples that agree have an error, too.
    assert first.standard_error == 0.0 < drawn.standard_error


def test_opposite_offsets_of_a_belief_change_the_chance():
    settled, count = settle(0.66), len(HOME.roller_positions)
    by_rollers = core.grasp_gradient(settled).required_friction[:count]
    along = by_rollers / np.linalg.norm(by_rollers)
    chances = []
    for direction in (along, np.linalg.svd(along[None])[2][1]):
        covariance = 0.04**2 * np.outer(direction, direction)
        given = replace(CALIBRATED, offset_covariance=covariance)
        assert given.covariance(settled.equilibrium)[:count, :count] == pytest.approx(covariance)
        chances.append(settled.chance(given).shares['roller offsets'])
    assert chances[0] > 0.1
    assert chances[1] < 0.1 * chances[0]


@pytest.mark.parametrize(
    ('uncertainty', 'columns'),
    some_now(
        [(CALIBRATED, range(2, 18, 8)), *product((CALIBRATED, core.Uncertainty()), [range(18)])]
    ),
)
def test_gradient_of_the_chance_is_that_of_grasps_settled_afresh(uncertainty, columns):
    settled = settle(0.66)
    gradient = core.grasp_gradient(settled).chance(uncertainty)
    spread = np.sqrt(np.diag(uncertainty.covariance(settled.equilibrium)))
    for k in columns:
        unit = max(spread[k], 1e-3)
        changes = 3e-3 * unit * np.array([1.0, -1.0, 2.0, -2.0])
        ahead, behind, far_ahead, far_behind = (
            uncertainty.chance(settle_afresh(settled, change * np.eye(18)[k]), samples=0)
            for change in changes
        )
        near = ahead.probability - behind.probability
        far = far_ahead.probability - far_behind.probability
        rate = (8.0 * near - far) / (12.0 * changes[0])
        # Each component, also a small one, to 1e-4 of itself.
        assert unit * gradient[k] == pytest.approx(unit * rate, rel=1e-4, abs=1e-8)


def test_chance_by_an_interval_of_friction_does_not_depend_on_the_coefficient_of_the_grasp():
    settled, known = settle(0.66), replace(CALIBRATED, friction=(0.6, 0.8))
    friction = core.grasp_gradient(settled).parameters.friction
    gradient = core.grasp_gradient(settled).chance(known)
    assert gradient[friction] == 0.0
    others = (known.chance(settle(value), samples=0).probability for value in (0.66, 0.7))
    assert next(others) == pytest.approx(next(others), abs=1e-12)
    assert np.abs(np.delete(gradient, friction)).max() > 0.0


FAR, NEAR = ({'wrench': (0.0, 0.0, 0.0), 'depth': depth} for depth in (-0.001, 0.02))
WIDE = 1e6 * np.eye(6)
#: Words of refusals, the fields of an uncertainty, the grasp, and the number of samples.
REFUSED = [
    ('friction: 5.0: .* 2; if it is in percent, it is 0.05', {'friction': 5.0}, NEAR, 0),
    ('position: 3.0: must be .*, from 0 to 0.05; if it is in cm', {'position': 3.0}, NEAR, 0),
    ('size: nan: must be', {'size': float('nan')}, NEAR, 0),
    ('covariance .* positive semidefinite', {'offset_covariance': -np.eye(6)}, NEAR, 0),
    ('must be 6 x 6', {'offset_covariance': np.eye(2)}, NEAR, None),
    ('the roller offsets must deviate less', {'offset_covariance': WIDE}, NEAR, 3),
    ('the smallest coefficient, then', {'friction': (0.8, 0.5)}, NEAR, 0),
    ('smallest and largest', {'friction': (0.5,)}, NEAR, 0),
    ('from 0 to 10', {'friction': (0, 11)}, NEAR, 0),
    ('samples -1: must be an integer, not negative', {}, NEAR, -1),
    ('samples 0: must be positive', vars(CERTAIN), FAR, 0),
]


@pytest.mark.parametrize(('words', 'fields', 'grasp', 'samples'), REFUSED)
def test_implausible_deviations_and_samples_are_refused(words, fields, grasp, samples):
    with pytest.raises(GraspError, match=words):
        settle(**grasp).chance(core.Uncertainty(**fields), samples=samples)


def test_files_describe_the_uncertainty():
    known = {'stiffness_deviation': 0.05, 'zero_deviations': {'south/P': 0.001}}
    block = {'friction': 0.2, 'stiffness': 0.06}
    file = replace(HOME.robot.description, calibration=known, uncertainty=block)
    robot = core.Robot(file)
    body = core.read_object('{shape: disc, diameter: 0.3, uncertainty: {friction: 0.03}}')
    read = core.Uncertainty.of(robot, body, '{size: 0.02}')
    assert (read.friction, read.stiffness, read.size) == (0.03, 0.06, 0.02)
    assert read.offset_covariance[0, 0] == pytest.approx(1e-6)
    assert core.Uncertainty.of(robot, None, {'roller_offset': 0.003}).offset_covariance is None
    document = robots.preset_document('nine_member') | {'uncertainty': {'friction': [0.5, 0.8]}}
    assert core.Uncertainty.of(robots.load(document)).friction == (0.5, 0.8)


def test_files_with_implausible_uncertainty_are_refused(tmp_path):
    with pytest.raises(ObjectFileError, match='uncertainty: position: 3: must be'):
        core.read_object('{shape: disc, diameter: 0.3, uncertainty: {position: 3}}')
    with pytest.raises(GraspError, match="unknown key 'frction'; did you mean friction"):
        core.Uncertainty.of(HOME.robot, None, '{frction: 0.1}')
    text = Path(HOME.robot.description.source).read_text(encoding='utf-8')
    file = tmp_path / 'robot.yaml'
    file.write_text(f'{text}\nuncertainty: {{friction: 5}}\n')
    with pytest.raises(RobotFileError, match=r'uncertainty\.friction: 5: must be'):
        core.load_robot(file)


FRICTION = 0.8
DISC = core.ConvexObject.disc((0.5, 0.3), 0.3)
UNCALIBRATED = core.Uncertainty(stiffness=0.15, roller_offset=0.005, force=0.3)
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
    (at_rest, 'three members', 1e-4),
    *((carried, name, 2e-3) for name in ('disc 0.2 m', 'brick')),
    *((at_rest, name, 1e-4) for name in ('brick', 'box', 'disc 0.2 m')),
]


@pytest.mark.parametrize(('find', 'name', 'accuracy'), some_now(EQUILIBRIA, 2))
def test_rates_of_criteria_are_those_of_rolled_equilibria(find, name, accuracy):
    passed, columns = find(name), GraspParameters.of(HOME)
    ends = slice(None, None, max(len(passed) - 1, 1))
    first = len(find_criteria(passed[:1], FRICTION).names) if passed[1:] else 0
    criteria = find_criteria(passed[ends], FRICTION)
    is_near = [not text.startswith('contact with') for text in criteria.names]
    near = first + np.flatnonzero(is_near[first:])
    spread = np.maximum(np.sqrt(np.diag(UNCALIBRATED.covariance(passed[0]))), 1e-3)
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


@cache
def plan(carry=(), is_certain=True):
    """Return the grasps for the nominal or for an uncertain robot."""
    needs = core.GraspRequirements(carry=carry, count=2)
    uncertainty = None if is_certain else UNCALIBRATED
    return core.plan_grasps(
        HOME, DISC, needs, max_rounds=1, uncertainty=uncertainty, thorough=False
    )


@pytest.fixture(params=some_now([((),), (CARRY,)]), ids=['grasp', 'carry'])
def plans(request):
    """Return the plans for the nominal and for the uncertain robot."""
    return plan(request.param), plan(request.param, is_certain=False)


def test_grasps_are_ranked_by_their_chance(plans):
    chances = [grasp.chance.probability for grasp in plans[1]]
    assert chances == sorted(chances, reverse=True)
    assert [grasp.score for grasp in plans[1]] == [g.chance.reliability for g in plans[1]]


def test_the_chance_of_planned_grasps_is_that_from_samples():
    grasps = plan(is_certain=False)
    best = grasps[0]
    settled = core.settle_grasp(best.config, best.grip.body, 0.5, members=best.members)
    assert best.chance == settled.chance(UNCALIBRATED, samples=200)
    assert len(grasps) == 2


@pytest.mark.nightly
def test_the_chance_of_grasps_that_are_carried_is_to_first_order():
    assert {grasp.chance.method for grasp in plan(CARRY, is_certain=False)} == {'first order'}


def test_the_best_grasp_has_a_larger_chance_than_the_nominal_one(plans):
    grasp = plans[0][0]
    body = grasp.grip.body
    held = attach_grip(grasp.config, body, grasp.equilibrium.members)
    nominal = find_chance([held], 0.5, UNCALIBRATED.covariance(held))
    assert plans[1][0].chance.reliability > nominal.reliability


def test_the_chance_is_stated_only_with_an_uncertainty(plans):
    assert 'held with a chance of 0.9' in plan_in_words(plans[1])
    assert export_figures(plans[1][0])['chance'] == plans[1][0].chance.probability
    assert 'chance' not in plan_in_words(plans[0])
    assert 'chance' not in export_figures(plans[0][0])


def test_the_chance_is_that_under_the_required_wrench():
    needs = core.GraspRequirements(external_wrench=(0.0, -1.0, 0.0), count=1)
    options = {'max_rounds': 1, 'uncertainty': UNCALIBRATED, 'thorough': False}
    loaded = core.plan_grasps(HOME, DISC, needs, **options)
    assert loaded[0].chance.reliability < plan(is_certain=False)[0].chance.reliability


CONFIG, CYLINDER = gripped(40.0, squeeze=0.04)
SETTLED = core.settle_grasp(CONFIG, CYLINDER, 0.9)
REQUIRED = SETTLED.required_friction


@pytest.mark.parametrize(
    ('below', 'above', 'share'),
    [(-0.2, -0.1, 0.0), (-0.2, 0.1, 1.0 / 3.0), (0.1, 0.2, 1.0), (0.1, 0.1, 1.0)],
)
def test_chance_from_samples_is_the_share_of_the_interval_that_suffices(below, above, share):
    uncertainty = replace(CERTAIN, friction=(REQUIRED + below, REQUIRED + above))
    assert SETTLED.chance(uncertainty, samples=4).probability == pytest.approx(share, abs=1e-4)


def test_chance_to_first_order_has_the_mean_and_variance_of_the_interval():
    half_width = 3.0**0.5 * 0.05  # of a uniform distribution with a standard deviation of 0.05
    interval = replace(CERTAIN, friction=(0.5 - half_width, 0.5 + half_width))
    normal = replace(CERTAIN, friction=0.05)
    expected = core.settle_grasp(CONFIG, CYLINDER, 0.5).chance(normal, samples=0)
    assert SETTLED.chance(interval, samples=0).probability == pytest.approx(expected.probability)


@pytest.mark.parametrize(
    ('interval', 'verdict'),
    [((-0.2, -0.01), 'lost'), ((-0.2, 0.1), 'unknown'), ((0.01, 0.1), 'held')],
)
def test_verdict_of_an_interval_holds_for_all_of_its_coefficients(interval, verdict):
    smallest, largest = interval
    friction = REQUIRED + smallest, REQUIRED + largest
    assert SETTLED.friction_range.verdict(friction) == verdict
