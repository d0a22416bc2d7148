# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What friction cannot balance: against linear programs, models by hand and real contacts."""

from types import SimpleNamespace

from isotruss_ros.core import ConvexObject, load_robot, tangent_center
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.numerics.arrays import as_xy
from isotruss_ros.core.planning.closing import Closing
from isotruss_ros.core.planning.closing_on_ground import find_correction
import numpy as np
import pytest
import robots

ROBOT = load_robot('nine_member')
MODULES = ('north/Z', 'north/P', 'north/R', 'east/R', 'south/P')
FRICTION = 0.4


class Contacts:
    """
    Contacts spread over the sides of a grip; their forces follow the depths of the sides.

    :param seed: of all that is random.
    :param count: of contacts at each side.
    """

    def __init__(self, seed, count=4, third=False, spread=0.1):
        self.rng = rng = np.random.default_rng(seed)
        module = MODULES[seed % len(MODULES)]
        self.config = robots.random_state(ROBOT, rng)
        self.body = ConvexObject.disc(tangent_center(self.config, module, 0.3), 0.3)
        names = members_at(ROBOT, module)
        self.sides = tuple(ROBOT.member_names.index(name) for name in names)
        if third:
            tube = np.flatnonzero(ROBOT.topology.tube == ROBOT.topology.tube[self.sides[0]])
            self.sides = (*self.sides, *set(tube.tolist()).difference(self.sides))
        self.closing = Closing(self.body, self.sides, (), 0.0)
        self.pushes = as_xy(-self.closing.normals(self.config))
        self.pressed = rng.uniform(2.0, 60.0, len(self.sides))
        self.parts = rng.dirichlet(np.ones(count), len(self.sides))
        angles = np.arctan2(-self.pushes[:, 1], -self.pushes[:, 0])
        self.angles = angles[:, None] + spread * rng.uniform(-1.0, 1.0, (len(self.sides), count))
        self.wrench = rng.uniform(-2.0, 2.0, 3)

    def forces(self):
        """Return the normal forces, (s, count) [N]."""
        return self.pressed[:, None] * self.parts

    def analysis(self):
        """Return what an analysis of these contacts would say, with some that do not touch."""
        forces = self.forces()
        normals = np.stack([np.cos(self.angles), np.sin(self.angles)], axis=-1)
        names = [ROBOT.member_names[i] for i in self.sides]
        away = np.array([[1.0, 0.0], [0.0, 1.0]])
        pressed = -(forces[..., None] * normals).sum(axis=(0, 1))
        return SimpleNamespace(
            normal_wrench=np.append(pressed, 0.0),
            points=np.array(self.body.pose[:2])
            + self.body.arm * np.concatenate([normals.reshape(-1, 2), away]),
            normal_forces=np.append(forces.ravel(), [0.0, 0.0]),
            normals=np.concatenate([normals.reshape(-1, 2), away]),
            contact_forces=dict(zip(names, forces.sum(axis=1), strict=True)),
        )

    def correction(self):
        """Return by how much the members are to press harder, (s,) [N]."""
        return find_correction(self.config, self.closing, self.analysis(), self.wrench)

    def model(self):
        """Return what a member's force does to the object, (3, s), moments over d/2 [-]."""
        return np.vstack([self.pushes.T, np.zeros(len(self.sides))])

    def friction_wrenches(self):
        """Return what friction of coefficient 1 does at each contact, (k, 3), moments over d/2."""
        forces, angles = self.forces().ravel(), self.angles.ravel()
        unit = np.stack([-np.sin(angles), np.cos(angles), np.ones(len(angles))], axis=1)
        return forces[:, None] * unit

    def load(self):
        """Return the resultant of the normal forces and the external wrench, (3,)."""
        forces, angles = self.forces().ravel(), self.angles.ravel()
        pressed = -np.array([forces @ np.cos(angles), forces @ np.sin(angles), 0.0])
        return pressed + self.wrench / (1.0, 1.0, 0.15)


@pytest.mark.parametrize('seed', range(10))
def test_two_members_balance_the_load_across_the_plane_of_friction(seed):
    contacts = Contacts(seed)
    # The direction in which friction brings about the least.
    wrenches, change = contacts.friction_wrenches(), contacts.correction()
    across = np.linalg.eigh(wrenches.T @ wrenches)[1][:, 0]
    assert change.sum() == pytest.approx(0.0, abs=1e-9)
    left = across @ (contacts.load() + contacts.model() @ change)
    assert left == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize('seed', range(10))
def test_three_members_balance_the_resultant_force_but_for_the_squeeze(seed):
    contacts = Contacts(seed, third=True)
    change = contacts.correction()
    assert change.sum() == pytest.approx(0.0, abs=1e-9)
    left = contacts.load() + contacts.model() @ change
    assert left[:2] == pytest.approx(0.0, abs=1e-9)
