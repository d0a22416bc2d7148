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

from isotruss_ros.core import analyze_grasp, ConvexObject, load_robot, tangent_center
from isotruss_ros.core.planning.closing import Closing
from isotruss_ros.core.planning.closing_on_ground import find_correction
import numpy as np
import pytest
import robots
from scipy.optimize import minimize

ROBOT = load_robot('nine_member')
MODULES = ('north/Z', 'north/P', 'north/R', 'east/R', 'south/P')
FRICTION = 0.4


def sides_of(robot, module):
    """Return the numbers of the members that meet at a module, by their names."""
    tube, joint = module.split('/')
    ahead = next(i for i, n in enumerate(robot.member_names) if n.startswith(f'{module}-'))
    back = next(
        i
        for i, n in enumerate(robot.member_names)
        if n.startswith(f'{tube}/') and n.endswith(f'-{joint}')
    )
    return ahead, back


def pushes(config, sides, body):
    """Return the unit vectors along which sides push an object that touches them, (s, 2)."""
    place = dict(zip(config.robot.node_names, config.nodes, strict=True))
    found = []
    for i in sides:
        tube, ends = config.robot.member_names[i].split('/')
        one, other = ends.split('-')
        begin, end = place[f'{tube}/{one}/B'], place[f'{tube}/{other}/C']
        along = (end - begin) / np.linalg.norm(end - begin)
        across = np.array([-along[1], along[0]])
        found.append(across * np.sign(across @ (np.array(body.pose[:2]) - begin)))
    return np.array(found)


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
        self.sides = sides_of(ROBOT, module)
        if third:
            tube = np.flatnonzero(ROBOT.topology.tube == ROBOT.topology.tube[self.sides[0]])
            self.sides = (*self.sides, *set(tube.tolist()).difference(self.sides))
        self.pushes = pushes(self.config, self.sides, self.body)
        self.depths = rng.uniform(0.005, 0.03, len(self.sides))
        self.stiffness = rng.uniform(300.0, 2000.0, len(self.sides))
        self.parts = rng.dirichlet(np.ones(count), len(self.sides))
        angles = np.arctan2(-self.pushes[:, 1], -self.pushes[:, 0])
        self.angles = angles[:, None] + spread * rng.uniform(-1.0, 1.0, (len(self.sides), count))
        self.wrench = rng.uniform(-2.0, 2.0, 3)

    def forces(self, depths):
        """Return the normal forces, (s, count) [N]."""
        return (self.stiffness * depths)[:, None] * self.parts

    def analysis(self, depths=None, angles=None):
        """Return what an analysis of these contacts would say, with some that do not touch."""
        forces = self.forces(self.depths if depths is None else depths)
        angles = self.angles if angles is None else angles
        normals = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
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

    def correction(self, analysis=None):
        """Return by how much the members are to press harder, (s,) [N]."""
        closing, analysis = Closing(self.body, self.sides, (), 0.0), analysis or self.analysis()
        return find_correction(self.config, closing, analysis, self.wrench)

    def model(self):
        """Return what a member's force does to the object, (3, s), moments over d/2 [-]."""
        return np.vstack([self.pushes.T, np.zeros(len(self.sides))])

    def friction_wrenches(self):
        """Return what friction of coefficient 1 does at each contact, (k, 3), moments over d/2."""
        forces, angles = self.forces(self.depths).ravel(), self.angles.ravel()
        unit = np.stack([-np.sin(angles), np.cos(angles), np.ones(len(angles))], axis=1)
        return forces[:, None] * unit

    def load(self):
        """Return the resultant of the normal forces and the external wrench, (3,)."""
        forces, angles = self.forces(self.depths).ravel(), self.angles.ravel()
        pressed = -np.array([forces @ np.cos(angles), forces @ np.sin(angles), 0.0])
        return pressed + self.wrench / (1.0, 1.0, 0.15)


def across_of(segments):
    """Return the direction in which friction brings about the least, by a search."""

    def share(angles):
        one, two = angles
        axis = np.array([np.cos(one) * np.cos(two), np.sin(one) * np.cos(two), np.sin(two)])
        return np.square(segments @ axis).sum(), axis

    starts = [(a, b) for a in np.arange(0.0, np.pi, 0.7) for b in (-1.0, 0.0, 1.0)]
    found = min(
        (minimize(lambda x: share(x)[0], s, tol=1e-14) for s in starts), key=lambda f: f.fun
    )
    return share(found.x)[1]


@pytest.mark.parametrize('seed', range(10))
def test_two_members_balance_the_load_across_the_plane_of_friction(seed):
    contacts = Contacts(seed)
    across, change = across_of(contacts.friction_wrenches()), contacts.correction()
    assert change.sum() == pytest.approx(0.0, abs=1e-9)
    left = across @ (contacts.load() + contacts.model() @ change)
    assert left == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize('seed', range(10))
def test_three_members_balance_the_resultant_force_but_for_the_squeeze(seed):
    contacts = Contacts(seed, third=True)
    change = contacts.correction()
    assert change.sum() == pytest.approx(0.0, abs=1e-9)
    left = contacts.load() + contacts.model() @ change
    assert left[:2] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ('preset', 'module'),
    [('nine_member', 'north/Z'), ('triangle', 'main/T'), ('triangle', 'main/L')],
)
def test_real_members_come_to_a_balance(preset, module):
    # Depths that follow the correction leave less and less of it: the structure is one.
    config = robots.random_state(load_robot(preset), np.random.default_rng(1))
    sides = sides_of(config.robot, module)
    snug = np.array(tangent_center(config, module, 0.3))
    into = pushes(config, sides, ConvexObject.disc(tuple(snug), 0.3))
    depths, left = np.array([0.015, 0.025]), []
    for _ in range(4):
        body = ConvexObject.disc(tuple(snug - np.linalg.solve(into, depths)), 0.3)
        analysis = analyze_grasp(config, body, FRICTION, spacing=0.0025)
        closing = Closing(body, sides, (), 0.0)
        change = find_correction(config, closing, analysis, (0.0, 0.0, 0.0))
        forces = [analysis.contact_forces[config.robot.member_names[i]] for i in sides]
        left.append(np.abs(change).max() / sum(forces))
        depths = depths * (1.0 + change / forces)
    assert left[0] > 0.01
    assert left[-1] < 0.5 * left[0]
