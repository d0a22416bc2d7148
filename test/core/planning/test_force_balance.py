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
from isotruss_ros.core.planning.closing_on_ground import find_imbalance
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

    def imbalance(self, **given):
        """Return the imbalance."""
        analysis = given.pop('analysis', None) or self.analysis()
        closing = Closing(self.body, self.sides, (), 0.0)
        depths = given.pop('depths', self.depths)
        return find_imbalance(self.config, closing, analysis, self.wrench, depths)

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
def test_load_is_that_across_the_plane_of_friction(seed):
    contacts = Contacts(seed)
    found, segments = contacts.imbalance(), contacts.friction_wrenches()
    across = across_of(segments)
    assert abs(found.load[0]) == pytest.approx(abs(across @ contacts.load()), rel=1e-3, abs=1e-3)
    assert found.load.shape == (1,)
    assert found.slope.shape == (1, 2)


@pytest.mark.parametrize('seed', range(10))
@pytest.mark.parametrize('third', [False, True])
def test_slope_is_that_of_sides_that_are_springs(seed, third):
    # All contacts of a side in one place, so that across stays where it is.
    contacts = Contacts(seed, third=third, spread=0.0)

    def load(depths):
        return contacts.imbalance(analysis=contacts.analysis(depths), depths=depths).load

    slope = contacts.imbalance().slope
    steps = 1e-7 * np.eye(len(contacts.sides))
    numeric = np.column_stack(
        [(load(contacts.depths + s) - load(contacts.depths - s)) / 2e-7 for s in steps]
    )
    assert slope == pytest.approx(numeric, rel=1e-4, abs=1e-2)


@pytest.mark.parametrize('seed', range(10))
def test_axis_has_always_the_same_sign(seed):
    # Secants compare loads of one step with those of the next.
    contacts = Contacts(seed)
    found = contacts.imbalance()
    assert found.slope[0, 0] >= found.slope[0, 1]
    turned = 1e-6 * contacts.rng.standard_normal(contacts.angles.shape)
    other = contacts.imbalance(analysis=contacts.analysis(angles=contacts.angles + turned))
    assert other.load == pytest.approx(found.load, abs=1e-2)


@pytest.mark.parametrize('seed', range(10))
def test_three_sides_are_balanced_by_their_forces(seed):
    contacts = Contacts(seed, third=True)
    found = contacts.imbalance()
    assert found.load == pytest.approx(contacts.load()[:2])
    # What each side's spring adds to the load goes the way in which it pushes.
    for push, stiffness, slope in zip(
        contacts.pushes, contacts.stiffness, found.slope.T, strict=True
    ):
        assert slope == pytest.approx(stiffness * push)


def test_a_side_that_does_not_press_leaves_nothing_to_be_balanced():
    for third in (False, True):
        contacts = Contacts(3, third=third)
        for i in contacts.sides:
            analysis = contacts.analysis()
            del analysis.contact_forces[ROBOT.member_names[i]]
            assert contacts.imbalance(analysis=analysis) is None


def test_a_side_that_presses_lightly_counts():
    contacts = Contacts(3)
    light = contacts.analysis(1e-3 * contacts.depths)
    assert 0.0 < min(light.contact_forces.values()) < 0.1
    assert contacts.imbalance(analysis=light) is not None


@pytest.mark.parametrize(
    ('preset', 'module'),
    [('nine_member', 'north/Z'), ('triangle', 'main/T'), ('triangle', 'main/L')],
)
def test_real_sides_answer_as_the_slope_says(preset, module):
    # Pressing one side harder than the other moves the load that way; not as far, or further,
    # since the structure behind the sides is one.
    config = robots.random_state(load_robot(preset), np.random.default_rng(1))
    sides = sides_of(config.robot, module)
    snug = np.array(tangent_center(config, module, 0.3))
    into = pushes(config, sides, ConvexObject.disc(tuple(snug), 0.3))

    def at(depths):
        body = ConvexObject.disc(tuple(snug - np.linalg.solve(into, depths)), 0.3)
        analysis = analyze_grasp(config, body, FRICTION, spacing=0.0025)
        closing = Closing(body, sides, (), 0.0)
        return find_imbalance(config, closing, analysis, (0.0, 0.0, 0.0), depths)

    depths = np.array([0.02, 0.022])
    found = at(depths)
    for move in (np.array([0.002, -0.002]), np.array([-0.002, 0.002])):
        change, expected = at(depths + move).load - found.load, found.slope @ move
        assert 0.05 < change[0] / expected[0] < 3.0
