# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Gradients of settled and held grasps against central differences."""

import copy
from dataclasses import replace
from functools import cache
from itertools import islice
from typing import NamedTuple

from carries import GRASPS, make_robot, place
from grips import gripped
from held_grips import numbers
from isotruss_ros.core import (
    ConvexObject,
    Disc,
    Ellipse,
    grasp_gradient,
    place_between,
    Polygon,
    Robot,
    settle_grasp,
    tangent_center,
)
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.contact_search import ContactSet
from isotruss_ros.core.holding.held_gradient import held_gradient
from isotruss_ros.core.holding.held_grip import NotHeldError
from isotruss_ros.core.holding.held_shape import held_joints
from isotruss_ros.core.holding.roll_grip import roll_contacts
from isotruss_ros.core.holding.settle_grasp import assess_equilibrium
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.depths import member_depths
from nightly import some_now
import numpy as np
import pytest
from robots import preset, random_state

FILE = preset('nine_member').description
#: Laws of the order of the theory, at 34.5 kPa and 0.86 m from ring to ring.
LAWS = {
    'model': 'power_law',
    'axial': {'C': 8.0, 'a': 0.6, 'b': -0.2},
    'transverse': {'C': 0.5, 'a': 0.6, 'b': -1.2},
    'rotary': {'C': 0.3, 'a': 0.6, 'b': 0.9},
}
SECTION = {
    'model': 'section',
    'axial_rigidity': 4e3,
    'flexural_rigidity': 25.0,
    'shear_rigidity': 1.9e3,
}
ROBOTS = [
    Robot(FILE),
    Robot(replace(FILE, stiffness=SECTION, stiffness_scale=1.2)),
    Robot(replace(FILE, stiffness=LAWS)),
]
SPREAD = 2.0 * np.pi / 5.0 * np.arange(5)
BOX = np.array([(-1.0, -0.8), (1.0, -0.8), (1.0, 0.8), (-1.0, 0.8)])
#: At a module, apart, and three around the object.
MEMBERS = (
    ('north/P-Z', 'north/Z-R'),
    ('south/P-Q', 'north/R-P'),
    ('south/P-Q', 'south/Q-X', 'south/X-P'),
)
#: Steps of the differences, as shares of a step each.
SHARES = (1.0, -1.0, 2.0, -2.0, 4.0, -4.0)


class Chosen(NamedTuple):
    """What an optimiser chooses of a grasp."""

    config: Configuration
    body: ConvexObject
    wrench: np.ndarray
    pressures: np.ndarray
    friction: float = 0.5
    scale: float = 1.0

    def changed(self, change, parameters):
        """Return the same with other parameters."""
        config, body, wrench, pressures, friction, scale = self
        return Chosen(
            config.moved_to(config.roller_positions + change[parameters.rollers]),
            body.moved_to(np.add(body.pose, change[parameters.place])),
            wrench + change[parameters.wrench],
            pressures + change[parameters.pressures],
            friction + change[parameters.friction],
            scale + change[parameters.stiffness],
        )


class RandomGrasp:
    """A random grasp: of discs, polygons and ellipses, by tubes of all models."""

    def __init__(self, number):
        self.rng = rng = np.random.default_rng(number)
        robot = ROBOTS[number % 3]
        self.members = MEMBERS[number // 3 % 3]
        config = random_state(robot, rng, 0.01)
        angle = rng.uniform(-3.0, 3.0)
        if number % 4 == 3:
            angle = np.pi / 3.0 + 0.01 * rng.normal()  # a face on a side
        size, depth = rng.uniform(0.1, 0.25), rng.uniform(0.01, 0.03)
        corners = np.exp(1j * (rng.uniform(0.0, 0.9, 5) + SPREAD))
        narrow = rng.uniform(0.6, 0.95)
        grip, own = None, numbers(self.members)
        # Of three members it is to press on all.
        while grip is None or member_depths(config, grip.body)[own].min() < 0.003:
            size *= 1.01
            shape = (
                Disc(2.0 * size),
                Ellipse((size, narrow * size)),
                Polygon(size * corners.view(float).reshape(-1, 2)),
                Polygon(size * BOX, corner_radius=0.02),
            )[number % 4]
            try:
                grip = place_between(config, self.members, shape, angle, depth)
            except GraspError:
                continue  # too small for these members
        wrench = rng.uniform(-0.5, 0.5, 3) * (1.0, 1.0, 0.1)
        self.chosen = Chosen(config, grip.body, wrench, rng.uniform(25e3, 45e3, 3))

    def step(self, parameters, sizes):
        """Return how parameters change, (p,), in a random direction, by the sizes of that."""
        step, rng = np.zeros(parameters.size), copy.deepcopy(self.rng)
        for name, size in sizes.items():
            place = getattr(parameters, name)
            step[place] = size * rng.choice([-1.0, 1.0], np.shape(step[place]))
        return step


def largest_error(exact, reached, step):
    """
    Return the largest error of a gradient, as a share of the sum of what all parameters do.

    None where differences of other steps differ, as they do where something changes on the way.

    :param exact: rows (n, p) by name.
    :param reached: values (n,) by name, after steps by `SHARES`.
    :param step: (p,).
    """
    worst = 0.0
    for name, rows in exact.items():
        near, far, farthest = (
            (ahead[name] - behind[name]) / (2.0 * share)
            for ahead, behind, share in zip(reached[::2], reached[1::2], SHARES[::2], strict=True)
        )
        size = max((np.abs(rows) @ np.abs(step)).max(), 1e-7)
        best, other = (4.0 * near - far) / 3.0, (4.0 * far - farthest) / 3.0
        if np.abs(best - other).max() > 5e-7 * size:
            return None
        worst = max(worst, np.abs(rows @ step - best).max() / size)
    return worst


PRESSURES = {'pressures': 50.0}
OTHERS = {'rollers': 5e-5, 'place': 5e-5, 'friction': 1e-3, 'wrench': 5e-3, 'stiffness': 1e-3}


def settle(case, chosen):
    """Return a random grasp with other parameters; None without an equilibrium."""
    tubes = chosen.pressures, chosen.scale
    members = numbers(case.members)
    try:
        found = attach_grip(chosen.config, chosen.body, members, chosen.wrench, *tubes)
    except NotHeldError:
        return None
    return assess_equilibrium(chosen.body.pose, found, chosen.friction)


def values(grasp):
    """Return what a gradient is of, by the names of its fields."""
    grip = grasp.equilibrium
    return {
        'pose': np.array(grasp.pose),
        'normal_forces': np.array([*grasp.normal_forces.values()]),
        'friction_forces': np.array([*grasp.friction_forces.values()]),
        'required_friction': np.array([grasp.required_friction]),
        'squeeze': np.array([grip.squeeze]),
        'slip_margin': np.array([grasp.slip_margin]),
        'stiffness': in_rows(grasp.stiffness, grip.arm)[:, 0],
        'utilisation': np.array([*grasp.utilisation.values()]),
    }


@cache
def settled_grasp(number):
    """Return a random grasp, and its equilibrium, None without one."""
    case = RandomGrasp(number)
    return case, settle(case, case.chosen)


def in_rows(stiffness, arm):
    """Return a stiffness, or how it changes, in nine rows, moments and angles over the arm."""
    sizes = np.outer((1.0, 1.0, arm), (1.0, 1.0, arm))
    return (stiffness.reshape(3, 3, -1) / sizes[..., None]).reshape(9, -1)


def is_alike(one, other):
    """Tell whether two grasps have the same contacts, and the same most loaded places."""
    if other is None or other.equilibrium is None:
        return False
    places = [np.array([*each.utilisation_places.values()]) for each in (one, other)]
    if np.abs(places[1] - places[0]).max() > 0.01:
        return False
    first, second = one.equilibrium.contacts, other.equilibrium.contacts
    return np.array_equal(first.members, second.members) and np.array_equal(
        first.corners, second.corners
    )


def error(number, sizes):
    """Return the largest error of the gradient of a random grasp; None if there is none."""
    case, grasp = settled_grasp(number)
    if grasp is None or grasp.equilibrium is None:
        return None
    gradient = grasp_gradient(grasp)
    step = case.step(gradient.parameters, sizes)
    moved = [
        settle(case, case.chosen.changed(share * step, gradient.parameters)) for share in SHARES
    ]
    if not all(is_alike(grasp, each) for each in moved):
        return None
    reached = [values(each) for each in moved]
    exact = {name: np.atleast_2d(getattr(gradient, name)) for name in reached[0]}
    exact['stiffness'] = in_rows(gradient.stiffness, grasp.equilibrium.arm)
    return largest_error(exact, reached, step)


def fitted_slope(find, size=1e-5):
    """Return the slope at zero of a cubic through 21 values, whose rounding errors it averages."""
    shares = np.linspace(-1.0, 1.0, 21)
    samples = np.array([find(size * share) for share in shares])
    slopes = np.polyfit(shares, samples.reshape(len(shares), -1), 3)[-2] / size
    return slopes.reshape(samples.shape[1:])


@pytest.mark.parametrize('number', some_now([594, 516]))
def test_stiffness_derivatives_beside_a_kink_agree_with_a_fitted_cubic(number):
    """A contact is 0.5 mm from a guide ring, or the end of a face presses with 0.1 N."""
    case, grasp = settled_grasp(number)
    gradient = grasp_gradient(grasp)
    first = np.eye(gradient.parameters.size)[0]

    def stiffness(change):
        moved = case.chosen.changed(change * first, gradient.parameters)
        return values(settle(case, moved))['stiffness']

    slope = fitted_slope(stiffness)
    rates = in_rows(gradient.stiffness, grasp.equilibrium.arm)[:, 0]
    assert rates == pytest.approx(slope, abs=2e-5 * np.abs(slope).max())


# First an ellipse; the special grasps below are of the other shapes.
@pytest.mark.parametrize(('numbers', 'wanted'), some_now([((1,), 1), (range(2000), 500)]))
def test_gradients_agree_with_central_differences(numbers, wanted):
    # Other pressures take new tables of dents, which take a while.
    cases = ((n, PRESSURES if n % 8 == 1 else OTHERS) for n in numbers)
    found = (error(*case) for case in cases)
    compared = [*islice((each for each in found if each is not None), wanted)]
    assert len(compared) == wanted
    assert max(compared) < 1e-6


@pytest.mark.parametrize(
    'number',
    [
        pytest.param(106, id='end of a face that touches without force'),
        pytest.param(248, id='stiffness that hardly changes'),
        pytest.param(563, id='contact 0.5 mm from a guide ring'),
        pytest.param(872, id='hardly bent member'),
    ],
)
def test_gradients_of_special_grasps_agree_with_central_differences(number):
    assert error(number, OTHERS) < 1e-6


def test_a_contact_without_force_bears_no_wrench_to_first_order():
    """The depth of a dent is proportional to the 2/3 power of the force: soft at zero force."""
    grip = settled_grasp(106)[1].equilibrium
    count, response = len(grip.contacts.members), grip.response
    idle = np.flatnonzero(np.abs(grip.state.normal_forces) < 1e-9)
    assert idle.tolist() == [2]
    assert np.abs(response.forces[[2, count + 2]]).max() < 1e-12 < np.abs(response.forces).max()
    assert response.ends.size == 0


@pytest.mark.parametrize(
    ('shape', 'angle', 'depth'),
    some_now(
        [
            # The force on one member is near an end of an interval of the table of dents.
            (Polygon(BOX * (0.15, 0.125), corner_radius=0.02), 0.5, 0.005),
            (Disc(0.3), 0.0, 0.01),
        ]
    ),
)
def test_stiffness_rates_agree_with_a_fitted_cubic(shape, angle, depth):
    home = preset('nine_member').home
    body = place_between(home, ('north/R-P', 'north/P-Z'), shape, angle, depth).body
    rates = grasp_gradient(settle_grasp(home, body, 0.9)).stiffness

    def stiffness(change):
        moved = home.moved_to(home.roller_positions + change * np.eye(6)[3])
        return settle_grasp(moved, body, 0.9).stiffness

    slope = fitted_slope(stiffness)
    assert rates[..., 3] == pytest.approx(slope, abs=1e-6 * np.abs(rates[..., :6]).max())


def test_pose_rates_of_a_face_beside_the_origin_agree_with_central_differences():
    """The object turns until its face is on the tube; its frame is beside its centroid."""
    home, members = preset('nine_member').home, ('north/R-P', 'north/P-Z')
    shape = Polygon(BOX * (0.15, 0.125) + (0.08, 0.05), corner_radius=0.02)
    body = place_between(home, members, shape, np.pi / 3.0 + 0.03, 0.01).body
    gradient = grasp_gradient(settled := settle_grasp(home, body, 5.0, members=members))
    assert abs(settled.displacement[2]) > 5e-3
    step, columns = 1e-5, []
    for change in step * np.eye(3):
        ahead, behind = (
            settle_grasp(home, body.moved_to(body.pose + sign * change), 5.0, members=members)
            for sign in (1.0, -1.0)
        )
        columns.append(np.subtract(ahead.pose, behind.pose) / (2.0 * step))
    found = gradient.pose[:, gradient.parameters.place]
    assert found == pytest.approx(np.array(columns).T, abs=1e-6)


def test_slip_margin_after_a_face_has_opened_agrees_with_central_differences():
    wrench, home = np.array([6.6, 5.6, 1.0]), preset('nine_member').home
    grip = place_between(home, MEMBERS[0], Polygon(0.22 * BOX, corner_radius=0.02), 1.07, 0.015)

    def settled(step):
        config = home.moved_to(home.roller_positions + step[:6])
        return settle_grasp(config, grip.body, 0.6, wrench + step[6:], members=MEMBERS[0])

    gradient = grasp_gradient(settled(np.zeros(9)))
    rates, places = gradient.slip_margin, gradient.parameters
    # In these directions the changes by all parameters add up.
    ahead = np.sign(np.append(rates[places.rollers], rates[places.wrench]))
    for step in ahead * [[1e-5] * 6 + [0.0] * 3, [0.0] * 6 + [3e-4] * 3]:
        change = settled(step).slip_margin - settled(-step).slip_margin
        exact = step[:6] @ rates[places.rollers] + step[6:] @ rates[places.wrench]
        assert change == pytest.approx(2.0 * exact, rel=1e-5, abs=1e-9)


def test_slip_margin_at_the_required_friction_is_zero_to_first_order():
    grasp = settle_grasp(*gripped(35.0, squeeze=0.08), external_wrench=(0.3, 0.0, 0.05))
    scarce = 1.001 * grasp.required_friction
    about_to = assess_equilibrium(grasp.pose, grasp.equilibrium, scarce)
    gradient = grasp_gradient(about_to)
    more = gradient.slip_margin[gradient.parameters.friction] * (scarce - grasp.required_friction)
    assert more == pytest.approx(about_to.slip_margin, rel=2e-3)


def test_slip_margin_of_a_symmetric_grasp_has_the_derivative_of_one_member():
    config = preset('nine_member').home
    body = ConvexObject.disc(tangent_center(config, 'north/Z', 0.3, 0.02), 0.3, friction=0.8)
    gradient = grasp_gradient(settle_grasp(config, body))
    sideways = gradient.slip_margin[gradient.parameters.wrench.start]
    # Both members are alike to 1e-5 only: the pull is much larger.
    toward, away = (
        settle_grasp(config, body, external_wrench=(pull, 0.0, 0.0)).slip_margin
        - gradient.settled.slip_margin
        for pull in (-1e-2 * np.sign(sideways), 1e-2 * np.sign(sideways))
    )
    assert toward == pytest.approx(-1e-2 * abs(sideways), rel=2e-3)
    assert away < 0.0  # the other member


ROBOT = make_robot()
STEP = 2e-5  # [m], of travel and anchors


def grip_of(name, scale=1.1):
    """Return a grasp away from home, with contacts that stick, under a load."""
    body, members = place(ROBOT, name, 0.5)
    found = attach_grip(ROBOT.home, body, numbers(members), stiffness=scale)
    travel = 4e-3 * np.random.default_rng(1).normal(size=6)
    there = np.concatenate([travel, found.anchors])
    # Once more, until the tubes have bent.
    return move(move(found, there), there)


def move(grip, values):
    """Return a grip under a load with other travel and anchors."""
    config = ROBOT.home.moved_to(values[:6])
    rolled = replace(grip, anchors=values[6:])
    return roll_contacts(rolled, config, ContactSet.of(grip.contacts), np.array([0.4, -0.3, 0.2]))


# First those of contacts at two members and at three, of the largest box and the smallest disc.
@pytest.mark.parametrize(
    'name', some_now(dict.fromkeys(['box', 'three members', 'disc 0.1 m', *GRASPS]), 3)
)
def test_held_gradient_agrees_with_finite_differences(name):
    grip = grip_of(name)
    found, columns = held_gradient(grip), []
    here = np.concatenate([grip.config.roller_positions, grip.anchors])
    for number in range(len(here)):
        values = []
        for sign in (1.0, -1.0):
            there = here.copy()
            there[number] += sign * STEP
            moved = move(move(grip, there), there)
            values.append(
                [moved.state.unknowns[:3], moved.normal_forces, held_joints(moved).ravel()]
            )
        columns.append([(a - b) / (2.0 * STEP) for a, b in zip(*values, strict=True)])
    exact = found.pose, found.normal_forces, found.joints
    for rates, differences in zip(exact, zip(*columns, strict=True), strict=True):
        size = np.abs(differences).max(axis=1) + 1e-3
        assert rates / size == pytest.approx(np.array(differences).T / size, abs=2e-3)
