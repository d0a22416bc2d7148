# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Probability that an object is held, against exact equilibria and against differences."""

from dataclasses import replace
from pathlib import Path

from carries import make_robot, place
from held_grips import APART, BOX
from isotruss_ros import core
from isotruss_ros.core.chance.criteria import (
    _bound_displacement,
    find_criteria,
    find_unknown_rates,
)
from isotruss_ros.core.chance.probability import (
    changed_grip,
    failure_probability,
    sample_friction,
)
from isotruss_ros.core.errors import (
    GraspError,
    ObjectFileError,
    RobotFileError,
)
from nightly import some_now
import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import multivariate_normal

HOME = core.load_robot('nine_member').home
#: The robot after calibration, with a disc whose size and pose are known well.
CALIBRATED = core.Uncertainty(stiffness=0.1, roller_offset=0.002, friction=0.08)
PULL = (0.5, -0.4, 0.01)
MEMBERS = ('north/P-Z', 'north/Z-R')
#: Parameters without deviations.
CERTAIN = core.Uncertainty(
    **dict.fromkeys(core.Uncertainty.__dataclass_fields__, 0.0) | {'offset_covariance': None}
)


def settle(friction=0.8, wrench=PULL, depth=0.02, diameter=0.3):
    """Return a disc in a corner of the robot at home."""
    x, y = core.tangent_center(HOME, 'north/Z', diameter)
    body = core.ConvexObject.disc((x + 0.002, y + depth), diameter)
    return core.settle_grasp(HOME, body, friction, wrench, members=MEMBERS)


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
        members=MEMBERS,
    )


def share_held(settled, uncertainty, count):
    """Return the share of own draws in which the disc is held, and its standard error."""
    covariance = uncertainty.covariance(settled.equilibrium or settled.lost)
    changes = np.random.default_rng(0).multivariate_normal(np.zeros(18), covariance, count)
    held = [settle_afresh(settled, change).held for change in changes]
    return np.mean(held), np.std(held) / np.sqrt(count)


@pytest.mark.parametrize('name', some_now(['brick', 'box', 'three members', 'disc 0.2 m'], 3))
def test_rates_of_criteria_are_those_of_exact_equilibria(name):
    body, members = place(make_robot(), name, 0.5)
    settled = core.settle_grasp(HOME, body, 0.8, (0.3, -0.2, 0.01), members=members)
    grip = settled.equilibrium
    criteria = find_criteria([grip], 0.8)
    spread = np.sqrt(np.diag(core.Uncertainty(force=0.5, moment=0.05).covariance(grip)))
    friction = core.grasp_gradient(settled).parameters.friction
    for k, step in enumerate(1e-3 * np.maximum(spread, 1e-3)):
        change = step * np.eye(len(spread))[k]
        ahead, behind = (
            find_criteria([changed_grip(grip, way * change)], 0.8 + way * change[friction]).values
            for way in (1.0, -1.0)
        )
        near = [not text.startswith('contact with') for text in criteria.names]
        rates = (ahead - behind)[near] / (2.0 * step)
        scale = np.abs(criteria.values[near]) / max(spread[k], 1e-3)
        # The dents of an object of another size are those of the given size.
        share = 1e-3 if k == len(spread) - 1 else 1e-4
        assert np.abs(rates - criteria.rates[near, k]).max() <= share * scale.max()


def test_components_of_a_large_displacement_turn_with_the_chord():
    grip = settle().equilibrium

    def displaced(grip):
        pose = np.add(grip.statics.body.pose, (0.02, -0.03, 0.0))
        return replace(grip, statics=replace(grip.statics, body=grip.statics.body.moved_to(pose)))

    rates, tubes = find_unknown_rates(grip)
    bounds = _bound_displacement(displaced(grip), tubes, rates)
    for k, change in enumerate(1e-5 * np.eye(3, rates.shape[1])):  # travel of three rollers [m]
        ahead, behind = (
            _bound_displacement(displaced(changed_grip(grip, way * change)), tubes, rates).values
            for way in (1.0, -1.0)
        )
        assert bounds.rates[:, k] == pytest.approx((ahead - behind) / 2e-5, abs=1e-5)


@pytest.mark.parametrize('correlation', [-0.9, 0.0, 0.7, 1.0])
def test_probability_of_two_violations_is_exact(correlation):
    matrix, sigmas = np.array([[1.0, correlation], [correlation, 1.0]]), np.array([0.75, 1.2])
    both = multivariate_normal(cov=matrix, allow_singular=True).cdf(sigmas)
    assert failure_probability(sigmas, matrix) == pytest.approx(1.0 - both, abs=1e-7)


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


@pytest.mark.parametrize(
    ('friction', 'uncertainty'),
    some_now(
        [(0.62, CALIBRATED), (0.65, core.Uncertainty()), (0.8, core.Uncertainty(stiffness=0.5))]
    ),
)
def test_chance_is_the_frequency_of_held_draws(friction, uncertainty):
    settled = settle(friction)
    share, error = share_held(settled, uncertainty, 100)
    chance = settled.chance(uncertainty)
    assert 0.1 < chance.probability < 0.99
    assert chance.probability == pytest.approx(share, abs=0.03 + 2.0 * error)


@pytest.mark.parametrize(
    ('quantity', 'deviation'), some_now([('pressure', 0.05), ('size', 0.03)], 2)
)
def test_sampled_chance_near_wrinkling_is_the_frequency_of_held_draws(quantity, deviation):
    settled = settle(1.2, wrench=(0.0, 0.0, 0.0), depth=0.0454)
    assert max(settled.utilisation.values()) == pytest.approx(0.985, abs=0.01)
    uncertainty = replace(CERTAIN, **{quantity: deviation})
    share, error = share_held(settled, uncertainty, 80)
    chance = settled.chance(uncertainty, samples=100)
    bound = 2.0 * np.hypot(error, chance.standard_error)
    assert chance.probability == pytest.approx(share, abs=bound)


def test_samples_about_a_lost_contact_are_grasps_settled_afresh():
    settled = settle(wrench=(0.0, 0.0, 0.0), depth=-0.001)
    assert settled.equilibrium is None
    uncertainty = replace(CERTAIN, position=0.003)
    share, error = share_held(settled, uncertainty, 80)
    chance = settled.chance(uncertainty)
    assert chance.method == 'samples'
    assert chance.limit == core.HoldStatus.NO_CONTACT.value
    assert chance.probability > 0.1
    assert chance.probability == pytest.approx(
        share, abs=2.0 * np.hypot(error, chance.standard_error)
    )
    with pytest.raises(GraspError, match='samples 0: must be positive'):
        settled.chance(uncertainty, samples=0)


def test_samples_agree_with_first_order_and_repeat():
    settled, shares = settle(0.66), []
    first = settled.chance(CALIBRATED, samples=0)
    drawn = settled.chance(CALIBRATED, samples=40, seed=1, on_progress=shares.append)
    assert drawn.probability == pytest.approx(
        first.probability, abs=0.02 + 3 * drawn.standard_error
    )
    assert 0.0 < drawn.standard_error < 0.07
    assert shares == pytest.approx(np.arange(1, 41) / 40)
    assert settled.chance(CALIBRATED, samples=40, seed=1) == drawn
    assert settled.chance(CALIBRATED, samples=40, seed=2) != drawn


def test_objects_with_corners_are_sampled_200_times():
    def stop(share):
        raise StopIteration(share)

    box = core.place_between(HOME, APART, BOX, 0.4, 0.01).body
    box = core.settle_grasp(HOME, box, 0.9, members=APART)
    with pytest.raises(StopIteration, match=r'0\.005'):
        box.chance(CALIBRATED, on_progress=stop)
    assert settle().chance(CALIBRATED).method == 'first order'


def test_shares_name_the_quantity_that_matters_most():
    chance = settle().chance(core.Uncertainty(friction=0.3, stiffness=0.01, roller_offset=1e-4))
    assert chance.limit.startswith('slip at north/')
    assert next(iter(chance.shares)) == 'friction'
    assert chance.shares['friction'] > 0.95
    assert sum(chance.shares.values()) == pytest.approx(1.0)


def test_friction_alone_decides_by_its_normal_distribution():
    settled = settle()
    sigmas = (settled.friction - settled.required_friction) / 0.1
    assert settled.chance(replace(CERTAIN, friction=0.1)).reliability == pytest.approx(sigmas)


def test_stiffness_that_wrinkles_a_tube_is_that_of_a_robot_file():
    settled = settle(1.2, wrench=(0.0, 0.0, 0.0), depth=0.05)

    def excess(stiffness):
        change = (stiffness - 1.0) * np.eye(18)[core.grasp_gradient(settled).parameters.stiffness]
        return max(settle_afresh(settled, change).utilisation.values()) - 1.0

    stiffest = brentq(excess, 0.7, 1.0, xtol=1e-4)
    chance = settled.chance(replace(CERTAIN, stiffness=0.1))
    assert chance.limit.startswith('wrinkling of')
    assert chance.reliability == pytest.approx((stiffest - 1.0) / 0.1, rel=0.08)


def test_samples_without_a_configuration_are_left_out():
    # Beyond 0.3 m to 0.6 m of travel of this roller, either way, there is no configuration.
    covariance = np.zeros((18, 18))
    roller = HOME.robot.roller_names.index('east/Q')
    covariance[roller, roller] = 1.0
    required = sample_friction(settle().equilibrium, covariance, 40, 0, None)
    assert 5 < len(required) < 30


def test_offsets_without_any_configuration_are_refused():
    uncertainty = replace(CERTAIN, offset_covariance=1e6 * np.eye(6))
    with pytest.raises(GraspError, match='the roller offsets must deviate less'):
        settle().chance(uncertainty, samples=3)


@pytest.mark.parametrize(('friction', 'probability'), [(0.8, 1.0), (0.2, 0.0)])
def test_without_deviations_the_chance_is_one_or_zero(friction, probability):
    first, drawn = (settle(friction).chance(CERTAIN, samples=n) for n in (0, 10))
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
        chances.append(settled.chance(given).shares['roller offsets'])
    assert chances[0] > 0.1
    assert chances[1] < 0.1 * chances[0]


@pytest.mark.parametrize('uncertainty', [CALIBRATED, core.Uncertainty()])
def test_gradient_of_the_chance_is_that_of_grasps_settled_afresh(uncertainty):
    settled = settle(0.66)
    gradient = core.grasp_gradient(settled).chance(uncertainty)
    spread = np.sqrt(np.diag(uncertainty.covariance(settled.equilibrium)))
    for k, unit in enumerate(np.maximum(spread, 1e-3)):
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


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({'friction': 5.0}, 'friction: 5.0: .*, from 0 to 2; if it is in percent, it is 0.05'),
        ({'position': 3.0}, 'position: 3.0: must be .*, from 0 to 0.05; if it is in cm'),
        ({'size': float('nan')}, 'size: nan: must be'),
        ({'offset_covariance': -np.eye(6)}, 'offset_covariance .* positive semidefinite'),
    ],
)
def test_implausible_deviations_are_refused(values, words):
    with pytest.raises(GraspError, match=words):
        core.Uncertainty(**values)


def test_covariance_of_another_robot_is_refused():
    with pytest.raises(GraspError, match=r'offset_covariance .* must be 6 x 6'):
        settle().chance(core.Uncertainty(offset_covariance=np.eye(2)))


def test_samples_that_are_no_number_are_refused():
    with pytest.raises(GraspError, match='samples -1: must be an integer, not negative'):
        settle().chance(core.Uncertainty(), samples=-1)


def test_files_describe_the_uncertainty(tmp_path):
    known = {'stiffness_deviation': 0.05, 'zero_deviations': {'south/P': 0.001}}
    block = {'friction': 0.2, 'stiffness': 0.06}
    file = replace(HOME.robot.description, calibration=known, uncertainty=block)
    robot = core.Robot(file)
    body = core.read_object('{shape: disc, diameter: 0.3, uncertainty: {friction: 0.03}}')
    read = core.Uncertainty.of(robot, body, '{size: 0.02}')
    assert (read.friction, read.stiffness, read.size) == (0.03, 0.06, 0.02)
    assert read.offset_covariance[0, 0] == pytest.approx(1e-6)
    assert core.Uncertainty.of(robot, None, {'roller_offset': 0.003}).offset_covariance is None


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
