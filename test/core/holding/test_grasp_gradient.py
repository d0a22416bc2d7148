# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Gradients of settled and held grasps against central differences."""

import copy
from dataclasses import replace
from functools import cache
from itertools import islice
from typing import NamedTuple

from carries import GRASPS, make_robot, place
from held_grips import numbers
from isotruss_ros import core
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.contact_search import ContactSet
from isotruss_ros.core.holding.grasp_gradient import held_gradient
from isotruss_ros.core.holding.held_shape import held_joints
from isotruss_ros.core.holding.roll_grip import roll_contacts
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
    core.Robot(FILE),
    core.Robot(replace(FILE, stiffness=SECTION, stiffness_scale=1.2)),
    core.Robot(replace(FILE, stiffness=LAWS)),
]
SPREAD = 2.0 * np.pi / 5.0 * np.arange(5)
BOX = np.array([(-1.0, -0.8), (1.0, -0.8), (1.0, 0.8), (-1.0, 0.8)])
#: At a module, apart, and three around the object.
MEMBERS = (
    ('north/P-Z', 'north/Z-R'),
    ('south/P-Q', 'north/R-P'),
    ('south/P-Q', 'south/Q-X', 'south/X-P'),
)
#: Position of the polygons' centres in their frames [m].
AWAY = (0.03, -0.02)
#: Steps of the differences, as shares of a step each.
SHARES = (1.0, -1.0, 2.0, -2.0, 4.0, -4.0)
PRESSURES = {'pressures': 50.0}
OTHERS = {'rollers': 5e-5, 'place': 5e-5, 'friction': 1e-3, 'wrench': 5e-3, 'stiffness': 1e-3}


class Grasp(NamedTuple):
    """The parameters of a grasp."""

    config: core.Configuration
    body: core.ConvexObject
    members: tuple[str, ...]
    wrench: np.ndarray
    pressures: np.ndarray
    friction: float = 0.5

    def changed(self, change, parameters):
        config, body, members, wrench, pressures, friction = self
        scale = config.robot.description.stiffness_scale * (1.0 + change[parameters.stiffness])
        robot = core.Robot(replace(config.robot.description, stiffness_scale=scale))
        return Grasp(
            robot.configuration(config.roller_positions + change[parameters.rollers]),
            body.moved_to(np.add(body.pose, change[parameters.place])),
            members,
            wrench + change[parameters.wrench],
            pressures + change[parameters.pressures],
            friction + change[parameters.friction],
        )

    def settle(self):
        config, body, members, wrench, pressures, friction = self
        return core.settle_grasp(config, body, friction, wrench, pressures, members)


def random_grasp(number):
    """Return a random grasp, of all shapes and models of tubes, and its generator."""
    rng = np.random.default_rng(number)
    members, config = MEMBERS[number // 3 % 3], random_state(ROBOTS[number % 3], rng, 0.01)
    angle = rng.uniform(-3.0, 3.0)
    if number % 4 == 3:
        angle = np.pi / 3.0 + 0.01 * rng.normal()  # a face on a side
    size, depth = rng.uniform(0.1, 0.25), rng.uniform(0.01, 0.03)
    corners = np.exp(1j * (rng.uniform(0.0, 0.9, 5) + SPREAD))
    narrow = rng.uniform(0.6, 0.95)
    grip = None
    # Three members are all pressed.
    while grip is None or member_depths(config, grip.body)[numbers(members)].min() < 0.003:
        size *= 1.01
        shape = (
            core.Disc(2.0 * size),
            core.Ellipse((size, narrow * size)),
            core.Polygon(size * corners.view(float).reshape(-1, 2) + AWAY),
            core.Polygon(size * BOX + AWAY, corner_radius=0.02),
        )[number % 4]
        try:
            grip = core.place_between(config, members, shape, angle, depth)
        except GraspError:
            continue  # too small for these members
    wrench = rng.uniform(-0.5, 0.5, 3) * (1.0, 1.0, 0.1)
    return Grasp(config, grip.body, members, wrench, rng.uniform(25e3, 45e3, 3)), rng


def largest_error(exact, reached, step):
    """Return the largest relative error of a gradient; None where it depends on the step."""
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


def values(settled):
    """Return the differentiated values of a settled grasp, by the names of the derivatives."""
    return {
        'pose': np.array(settled.pose),
        'normal_forces': np.array([*settled.normal_forces.values()]),
        'friction_forces': np.array([*settled.friction_forces.values()]),
        'required_friction': np.array([settled.required_friction]),
        'squeeze': np.array([np.mean([*settled.normal_forces.values()])]),
        'slip_margin': np.array([settled.slip_margin]),
        'stiffness': in_rows(settled.stiffness, settled.equilibrium.arm)[:, 0],
        'utilisation': np.array([*settled.utilisation.values()]),
    }


def in_rows(stiffness, arm):
    """Return a stiffness, or its derivatives, in nine rows, moments and angles over the arm."""
    sizes = np.outer((1.0, 1.0, arm), (1.0, 1.0, arm))
    return (stiffness.reshape(3, 3, -1) / sizes[..., None]).reshape(9, -1)


@cache
def settled_grasp(number):
    """Return a random grasp, its generator and its equilibrium."""
    grasp, rng = random_grasp(number)
    return grasp, rng, grasp.settle()


def is_alike(one, other):
    """Return whether two grasps have the same contacts, and the same most loaded places."""
    if other.equilibrium is None:
        return False
    places = [np.array([*each.utilisation_places.values()]) for each in (one, other)]
    first, second = one.equilibrium.contacts, other.equilibrium.contacts
    return (
        np.abs(places[1] - places[0]).max() < 0.01
        and np.array_equal(first.members, second.members)
        and np.array_equal(first.corners, second.corners)
    )


def error(number, sizes):
    """Return the largest error of the gradient of a random grasp; None if there is none."""
    grasp, rng, settled = settled_grasp(number)
    if settled.equilibrium is None:
        return None
    gradient, rng = core.grasp_gradient(settled), copy.deepcopy(rng)
    parameters, step = gradient.parameters, np.zeros(gradient.parameters.size)
    for name, size in sizes.items():
        columns = getattr(parameters, name)
        step[columns] = size * rng.choice([-1.0, 1.0], np.shape(step[columns]))
    moved = [grasp.changed(share * step, parameters).settle() for share in SHARES]
    if not all(is_alike(settled, each) for each in moved):
        return None
    reached = [values(each) for each in moved]
    exact = {name: np.atleast_2d(getattr(gradient, name)) for name in reached[0]}
    exact['stiffness'] = in_rows(gradient.stiffness, settled.equilibrium.arm)
    return largest_error(exact, reached, step)


# First an ellipse; the special grasps below are of the other shapes.
@pytest.mark.parametrize(('candidates', 'count'), some_now([((1,), 1), (range(2000), 40)]))
def test_gradients_agree_with_central_differences(candidates, count):
    # Other pressures take new tables of dents, which take a while.
    cases = ((n, PRESSURES if n % 8 == 1 else OTHERS) for n in candidates)
    errors = (error(*case) for case in cases)
    compared = [*islice((each for each in errors if each is not None), count)]
    assert len(compared) == count
    assert max(compared) < 1e-6


# The end of a face touches without force; a contact is 0.5 mm from a guide ring; the stiffness
# hardly changes; a member is hardly bent.
@pytest.mark.parametrize('number', some_now([106, 563, 248, 872], 2))
def test_gradients_of_special_grasps_agree_with_central_differences(number):
    assert error(number, OTHERS) < 1e-6


def test_slip_margin_of_a_symmetric_grasp_has_the_derivative_of_one_member():
    config = preset('nine_member').home
    body = core.ConvexObject.disc(
        core.tangent_center(config, 'north/Z', 0.3, 0.02), 0.3, friction=0.8
    )
    gradient = core.grasp_gradient(core.settle_grasp(config, body))
    sideways = gradient.slip_margin[gradient.parameters.wrench.start]
    # Both members are alike to 1e-5 only: the pull is much larger.
    toward, away = (
        core.settle_grasp(config, body, external_wrench=(pull, 0.0, 0.0)).slip_margin
        - gradient.settled.slip_margin
        for pull in (-1e-2 * np.sign(sideways), 1e-2 * np.sign(sideways))
    )
    assert toward == pytest.approx(-1e-2 * abs(sideways), rel=2e-3)
    assert away < 0.0  # the other member


ROBOT = make_robot()
STEP = 2e-5  # [m], of travel and anchors


def move(grip, coordinates):
    """Return a grip under a load with other travel and anchors."""
    config = ROBOT.home.moved_to(coordinates[:6])
    rolled = grip.with_anchors(coordinates[6:])
    contacts, load = ContactSet.of(grip.contacts), np.array([0.4, -0.3, 0.2])
    grip = roll_contacts(rolled, config, contacts, load)
    # Once more, until the tubes have bent.
    return roll_contacts(grip.with_anchors(coordinates[6:]), config, contacts, load)


# First contacts at two members and at three, of the largest box and the smallest disc.
@pytest.mark.parametrize(
    'name', some_now(dict.fromkeys(['box', 'three members', 'disc 0.1 m', *GRASPS]), 3)
)
def test_held_gradient_agrees_with_finite_differences(name):
    body, members = place(ROBOT, name, 0.5)
    attached = attach_grip(ROBOT.home, body, numbers(members), stiffness=1.1)
    travel = 4e-3 * np.random.default_rng(1).normal(size=6)
    here = np.concatenate([travel, attached.anchors])
    grip = move(attached, here)
    gradient, columns = held_gradient(grip), []
    for step in STEP * np.eye(len(here)):
        ahead, behind = (move(grip, here + sign * step) for sign in (1.0, -1.0))
        pairs = [
            (each.state.unknowns, each.normal_forces, held_joints(each).ravel())
            for each in (ahead, behind)
        ]
        columns.append([(a - b) / (2.0 * STEP) for a, b in zip(*pairs, strict=True)])
    exact = gradient.unknowns, gradient.normal_forces, gradient.joints
    for rates, differences in zip(exact, zip(*columns, strict=True), strict=True):
        size = np.abs(differences).max(axis=1) + 1e-3
        assert rates / size == pytest.approx(np.array(differences).T / size, abs=2e-3)
