# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Gradients of settled grasps against central differences of grasps that are settled anew."""

from dataclasses import replace
from itertools import islice

from grips import gripped
from held_grips import numbers
from isotruss_ros.core import (
    Disc,
    Ellipse,
    grasp_gradient,
    load_robot,
    place_between,
    Polygon,
    Robot,
    settle_grasp,
)
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.contact_statics import TubeModel
from isotruss_ros.core.holding.settle_grasp import assess_equilibrium
from isotruss_ros.core.kinematics.depths import member_depths
import numpy as np
import pytest
from robots import random_state

FILE = load_robot('nine_member').description
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
#: Steps of the differences, by group of parameters.
STEPS = {
    'rollers': 5e-5,
    'place': 5e-5,
    'pressures': 50.0,
    'friction': 1e-3,
    'wrench': 5e-3,
    'stiffness': 1e-3,
}
SHARES = (1.0, -1.0, 2.0, -2.0, 4.0, -4.0)


class Case:
    """A random grasp, and what it is with other parameters."""

    def __init__(self, number):
        self.rng = rng = np.random.default_rng(number)
        robot = ROBOTS[number % 3]
        self.members = MEMBERS[number // 3 % 3]
        self.config = random_state(robot, rng, 0.01)
        angle = rng.uniform(-3.0, 3.0)
        if number % 4 == 3:
            angle = np.pi / 3.0 + 0.01 * rng.normal()  # a face on a side
        size, depth = rng.uniform(0.1, 0.25), rng.uniform(0.01, 0.03)
        corners = np.exp(1j * (rng.uniform(0.0, 0.9, 5) + SPREAD))
        narrow = rng.uniform(0.6, 0.95)
        grip, own = None, numbers(self.members)
        # Of three members it is to press on all.
        while grip is None or member_depths(self.config, grip.body)[own].min() < 0.003:
            size *= 1.01
            shape = (
                Disc(2.0 * size),
                Ellipse((size, narrow * size)),
                Polygon(size * corners.view(float).reshape(-1, 2)),
                Polygon(size * BOX, corner_radius=0.02),
            )[number % 4]
            try:
                grip = place_between(self.config, self.members, shape, angle, depth)
            except GraspError:
                continue  # too small for these members
        self.body = grip.body
        self.wrench = rng.uniform(-0.5, 0.5, 3) * (1.0, 1.0, 0.1)
        self.pressures = rng.uniform(25e3, 45e3, 3)
        self.flattening = number % 5 > 0

    def settle(self, change=None, parameters=None):
        """Return the grasp with other parameters."""
        config, body, wrench = self.config, self.body, self.wrench
        pressures, scale, friction = self.pressures, 1.0, 0.5
        if change is not None:
            config = config.moved_to(config.roller_positions + change[parameters.rollers])
            body = body.moved_to(np.add(body.pose, change[parameters.place]))
            wrench = wrench + change[parameters.wrench]
            pressures = pressures + change[parameters.pressures]
            scale += change[parameters.stiffness]
            friction += change[parameters.friction]
        tubes = TubeModel(scale, self.flattening, pressures)
        found = attach_grip(config, body, numbers(self.members), wrench, tubes)
        return assess_equilibrium(body.pose, found, friction)


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


def in_rows(stiffness, arm):
    """Return a stiffness, or how it changes, in nine rows, moments and angles over the arm."""
    sizes = np.outer((1.0, 1.0, arm), (1.0, 1.0, arm))
    return (stiffness.reshape(3, 3, -1) / sizes[..., None]).reshape(9, -1)


def is_alike(one, other):
    """Tell whether two grasps have the same contacts, and the same most loaded places."""
    if other.equilibrium is None:
        return False
    places = [np.array([*each.utilisation_places.values()]) for each in (one, other)]
    if np.abs(places[1] - places[0]).max() > 0.01:
        return False
    first, second = one.equilibrium.contacts, other.equilibrium.contacts
    return np.array_equal(first.members, second.members) and np.array_equal(
        first.corners, second.corners
    )


def errors(case, groups):
    """
    Return the largest errors of the gradient in random directions, by groups and field.

    Of the sum of what all parameters do. None where contacts change on the way, or the tables of
    dents, which are made for angles in steps: there differences of other steps differ.
    """
    grasp = case.settle()
    if grasp.equilibrium is None:
        return None
    gradient = grasp_gradient(grasp)
    parameters, found = gradient.parameters, {}
    for group in groups:
        step = np.zeros(parameters.size)
        for name in group:
            place = getattr(parameters, name)
            step[place] = STEPS[name] * case.rng.choice([-1.0, 1.0], np.shape(step[place]))
        moved = [case.settle(share * step, parameters) for share in SHARES]
        if not all(is_alike(grasp, each) for each in moved):
            return None
        reached = [values(each) for each in moved]
        for name in reached[0]:
            near, far, farthest = (
                (ahead[name] - behind[name]) / (2.0 * share)
                for ahead, behind, share in zip(
                    reached[::2], reached[1::2], SHARES[::2], strict=True
                )
            )
            exact = np.atleast_2d(getattr(gradient, name))
            if name == 'stiffness':
                exact = in_rows(exact, grasp.equilibrium.arm)
            size = max((np.abs(exact) @ np.abs(step)).max(), 1e-7)
            best, other = (4.0 * near - far) / 3.0, (4.0 * far - farthest) / 3.0
            if np.abs(best - other).max() > 5e-7 * size:
                return None
            found[group, name] = np.abs(exact @ step - best).max() / size
    return found


@pytest.mark.parametrize('wanted', [40, pytest.param(500, marks=pytest.mark.nightly)])
def test_gradients_are_those_of_central_differences(wanted):
    pressures, others = ('pressures',), ('rollers', 'place', 'friction', 'wrench', 'stiffness')
    # Other pressures take new tables of dents, which take a while.
    found = (errors(Case(n), [others, pressures][: 1 + (n % 5 == 1)]) for n in range(3 * wanted))
    compared = [*islice((each for each in found if each is not None), wanted)]
    assert len(compared) == wanted
    assert max(max(each.values()) for each in compared) < 1e-6


def test_the_members_that_decide_are_named():
    case = Case(1)
    grasp = case.settle()
    gradient = grasp_gradient(grasp)
    assert gradient.needs_most == max(grasp.friction_used, key=grasp.friction_used.get)
    assert gradient.most_used == max(grasp.utilisation, key=grasp.utilisation.get)


def test_the_member_that_gives_way_is_the_one_that_is_about_to_slip():
    grasp = settle_grasp(*gripped(35.0, squeeze=0.08), external_wrench=(0.3, 0.0, 0.05))
    scarce = 1.001 * grasp.required_friction
    about_to = assess_equilibrium(grasp.pose, grasp.equilibrium, scarce)
    gradient = grasp_gradient(about_to)
    assert gradient.gives_way == gradient.needs_most
    # At the friction that it needs the margin is none.
    more = gradient.slip_margin[gradient.parameters.friction] * (scarce - grasp.required_friction)
    assert more == pytest.approx(about_to.slip_margin, rel=2e-3)


def test_friction_and_the_place_across_the_bisector_change_nothing():
    grasp = settle_grasp(*gripped(35.0, squeeze=0.08))
    gradient = grasp_gradient(grasp)
    one, other = grasp.equilibrium.state.normals
    across = 1j * (one + other)  # of the bisector of the members
    assert not gradient.normal_forces[:, gradient.parameters.friction].any()
    by_place = gradient.normal_forces[:, gradient.parameters.place]
    still = by_place @ (across.real, across.imag, 0.0)
    assert still == pytest.approx([0.0, 0.0], abs=1e-9 * np.abs(by_place).max())
    assert np.abs(by_place).max() > 100.0


def test_a_disc_that_is_set_down_turned_is_turned_and_else_the_same():
    gradient = grasp_gradient(settle_grasp(*gripped(35.0, squeeze=0.08)))
    turn = gradient.parameters.place.stop - 1
    assert gradient.pose[:, turn] == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)
    assert not gradient.normal_forces[:, turn].any()


def test_what_is_not_held_has_no_gradient():
    config, body = gripped(35.0, squeeze=0.08)
    away = body.moved_to((5.0, 5.0, 0.0))
    with pytest.raises(GraspError, match='without equilibrium'):
        grasp_gradient(settle_grasp(config, away))
