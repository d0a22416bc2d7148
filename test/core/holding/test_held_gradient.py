# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Gradients of held grips against central differences of grips that roll there."""

from dataclasses import replace

from carries import GRASPS, make_robot, place
from held_grips import numbers
from isotruss_ros.core.contact.dents import Indentation
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.contact_statics import TubeModel
from isotruss_ros.core.holding.held_gradient import held_gradient
from isotruss_ros.core.holding.loaded_frame import held_joints
from isotruss_ros.core.holding.roll_grip import roll_contacts
import numpy as np
import pytest

ROBOT = make_robot()
#: Steps of travel [m], wrench [N], stiffness [-] and anchors [m].
STEPS = np.repeat([2e-5, 5e-3, 1e-3, 2e-5], [6, 3, 1, 4])


def grip_of(name, scale=1.1):
    """Return a grasp away from home, with contacts that stick, under a load."""
    body, members = place(ROBOT, name, 0.5)
    found = attach_grip(ROBOT.home, body, numbers(members), tubes=TubeModel(scale))
    travel = 4e-3 * np.random.default_rng(1).normal(size=6)
    return move(found, np.concatenate([travel, [0.4, -0.3, 0.2, scale], found.anchors]))


def move(grip, values):
    """Return a grip with other travel, wrench, stiffness and anchors."""
    config = ROBOT.home.moved_to(values[:6])
    scale, softened = values[9], grip
    if scale != grip.tubes.stiffness_scale:
        tubes = grip.tubes._replace(stiffness_scale=scale)
        indentation = Indentation(grip.statics.indentation._tables, scale)
        statics = replace(grip.statics, indentation=indentation)
        softened = replace(grip, tubes=tubes, statics=statics)
    return roll_contacts(softened, config, grip.contacts, values[10:], grip.angles, values[6:9])


@pytest.mark.parametrize('name', GRASPS)
def test_the_gradient_is_that_of_differences(name):
    grip = grip_of(name)
    found, columns = held_gradient(grip), []
    here = np.concatenate(
        [grip.config.roller_positions, grip.wrench, [grip.tubes.stiffness_scale], grip.anchors]
    )
    for number, step in enumerate(STEPS[: len(here)]):
        values = []
        for sign in (1.0, -1.0):
            there = here.copy()
            there[number] += sign * step
            moved = move(grip, there)
            values.append(
                [moved.state.unknowns[:3], moved.normal_forces, held_joints(moved).ravel()]
            )
        columns.append([(a - b) / (2.0 * step) for a, b in zip(*values, strict=True)])
    exact = found.pose, found.normal_forces, found.joints
    for rates, differences in zip(exact, zip(*columns, strict=True), strict=True):
        size = np.abs(differences).max(axis=1) + 1e-3
        assert rates / size == pytest.approx(np.array(differences).T / size, abs=5e-4)


@pytest.mark.parametrize('name', ['disc 0.2 m', 'box'])
def test_the_places_are_those_of_the_held_joints(name):
    grip = grip_of(name)
    assert held_gradient(grip).places.reshape(-1, 2) == pytest.approx(held_joints(grip), abs=1e-12)
