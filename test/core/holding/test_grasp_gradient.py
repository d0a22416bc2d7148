# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Gradients of settled grasps against central differences of grasps that are settled anew."""

from itertools import islice

from grips import gripped
from held_grips import numbers
from isotruss_ros.core import grasp_gradient, settle_grasp
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.contact_statics import TubeModel
from isotruss_ros.core.holding.settle_grasp import assess_equilibrium
import numpy as np
import pytest
from random_grasps import largest_error, RandomGrasp, SHARES

PRESSURES = {'pressures': 50.0}
OTHERS = {'rollers': 5e-5, 'place': 5e-5, 'friction': 1e-3, 'wrench': 5e-3, 'stiffness': 1e-3}


def settle(case, chosen):
    """Return a random grasp with other parameters."""
    tubes = TubeModel(chosen.scale, case.flattening, chosen.pressures)
    members = numbers(case.members)
    found = attach_grip(chosen.config, chosen.body, members, chosen.wrench, tubes)
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


def error(number, sizes):
    """Return the largest error of the gradient of a random grasp; None if there is none."""
    case = RandomGrasp(number)
    grasp = settle(case, case.chosen)
    if grasp.equilibrium is None:
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


@pytest.mark.parametrize('wanted', [30, pytest.param(500, marks=pytest.mark.nightly)])
def test_gradients_are_those_of_central_differences(wanted):
    # Other pressures take new tables of dents, which take a while.
    cases = ((n, PRESSURES if n % 8 == 1 else OTHERS) for n in range(3 * wanted))
    found = (error(*case) for case in cases)
    compared = [*islice((each for each in found if each is not None), wanted)]
    assert len(compared) == wanted
    assert max(compared) < 1e-6


def test_the_members_that_decide_are_named():
    case = RandomGrasp(1)
    grasp = settle(case, case.chosen)
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


def test_what_is_not_held_has_no_gradient():
    config, body = gripped(35.0, squeeze=0.08)
    away = body.moved_to((5.0, 5.0, 0.0))
    with pytest.raises(GraspError, match='without equilibrium'):
        grasp_gradient(settle_grasp(config, away))
