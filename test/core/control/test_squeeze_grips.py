# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The squeeze and the pose of any convex object between any members, on the elastic plant."""

import math

from grips import MASSLESS
from isotruss_ros.core import (
    Disc,
    ElasticObject,
    Ellipse,
    Grip,
    HoldStatus,
    load_robot,
    place_between,
    Polygon,
    RollerFaults,
    SimulatedRobot,
    solve_twist,
)
from isotruss_ros.core.control.squeeze_control import SqueezeControl, SqueezeSettings
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.held_grip import HeldGrip
import numpy as np
import pytest

HOME = load_robot('nine_member').home
#: At home three members of three tubes close next to nothing around a disc.
OBLIQUE = HOME.moved_to(HOME.roller_positions + np.array([0.1, -0.1, 0.0, 0.1, -0.1, 0.05]))
APART = ('south/P-Q', 'north/R-P')  # sides of two tubes
AROUND = ('south/P-Q', 'east/Q-R', 'north/R-P')
BOX = Polygon([(-0.25, -0.2), (0.25, -0.2), (0.25, 0.2), (-0.25, 0.2)], corner_radius=0.02)
FRICTION, PERIOD = 1.2, 0.02


class Loop:
    """A controller and a plant, in step; the object is measured without errors."""

    def __init__(self, shape, angle, members, more=1.0, config=HOME):
        grip = place_between(config, members, shape, angle=angle, indentation=0.015)
        model = attach_grip(
            config, grip.body, np.array([HOME.robot.member_names.index(name) for name in members])
        )
        self.members, self.body = members, model.body
        self.object = ElasticObject(model.body, FRICTION)
        self.plant = SimulatedRobot(config, self.object, RollerFaults())
        self.plant.advance(0.0)
        self.target = more * self.object.grasp.squeeze
        self.control = SqueezeControl(SqueezeSettings(self.target, FRICTION, **MASSLESS))
        self.reference = np.array(self.plant.object_pose)
        self.errors = []

    def grip(self):
        """Return the grip as it is measured."""
        return Grip(self.members, self.body.moved_to(self.plant.object_pose), FRICTION)

    def run(self, twist, duration):
        """Follow a twist that begins and ends at rest."""
        count = round(duration / PERIOD)
        for k in range(count):
            wanted = (1.0 - np.cos(2.0 * np.pi * (k + 0.5) / count)) * np.array(twist)
            config, grip = self.plant.config, self.grip()

            def solve(twist, opening_rate, config=config, grip=grip):
                return solve_twist(config, grip, twist, opening_rate=opening_rate)

            assert self.control.follow(config, grip, PERIOD) is HoldStatus.HELD
            command = self.control.solve(wanted, PERIOD, solve)
            self.control.advance(wanted, command)
            self.plant.command(command.roller_velocities)
            self.plant.advance(PERIOD)
            self.reference = self.reference + PERIOD * wanted
            assert isinstance(self.object.grasp, HeldGrip)
            off = self.reference - np.array(self.plant.object_pose)
            self.errors.append((math.hypot(*off[:2]), abs(math.remainder(off[2], 2.0 * math.pi))))


@pytest.mark.parametrize(
    ('shape', 'angle', 'members'),
    [(BOX, 0.2, APART), (Ellipse((0.25, 0.2)), 1.0, APART), (BOX, 0.2, AROUND[:2])],
)
def test_pose_and_squeeze_of_a_grip_stay_as_they_should(shape, angle, members):
    loop = Loop(shape, angle, members)
    loop.run((0.01, -0.01, 0.03), 1.0)
    far, turned = np.max(loop.errors, axis=0)
    assert far < 2e-4
    assert turned < math.radians(0.1)
    assert loop.object.grasp.squeeze == pytest.approx(loop.target, rel=5e-3)


@pytest.mark.parametrize(
    ('shape', 'angle', 'members', 'config'),
    [(BOX, 0.2, APART, HOME), (Disc(0.83), 0.0, AROUND, OBLIQUE)],
)
def test_a_rising_target_closes_in_place(shape, angle, members, config):
    loop = Loop(shape, angle, members, 1.2, config)
    loop.run((0.0, 0.0, 0.0), 1.5)
    assert loop.object.grasp.squeeze == pytest.approx(loop.target, rel=5e-3)
    assert loop.errors[-1][0] < 2e-4


def test_an_unknown_load_is_found():
    loop = Loop(BOX, 0.2, APART)
    margin = loop.object.slip_margin
    assert margin > 0.5
    load = 0.4 * margin * np.array([0.6, 0.8, 0.0])
    loop.object.external_wrench = load
    loop.run((0.0, 0.0, 0.0), 2.0)
    assert loop.errors[-1][0] < 2e-4
    assert loop.control.model.load.wrench == pytest.approx(load, abs=0.1 * np.hypot(*load[:2]))
    assert loop.control.slip_margin == pytest.approx(loop.object.slip_margin, rel=0.05)
