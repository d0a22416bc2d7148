# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Many grasps at once: the numbers of `analyze_grasp` for each, whatever the others are."""

from dataclasses import fields

from isotruss_ros.core import analyze_grasp, analyze_grasps, Cylinder, GraspAnalyses, load_robot
from isotruss_ros.core.errors import GraspError, StructureError
from isotruss_ros.core.grasping import contact_stack
from isotruss_ros.core.grasping.contact_points import find_contact_points
from isotruss_ros.core.grasping.point_stack import stack_points
from isotruss_ros.core.grasping.surfaces import RoundSurface
from isotruss_ros.core.statics import frame_stack
from isotruss_ros.core.statics.pressures import tube_pressures
from isotruss_ros.core.statics.structure import structure_of
import numpy as np
import pytest
import robots

WRENCH = (0.4, -0.3, 0.02)
LAWS = {
    'model': 'power_law',
    'axial': {'C': 1.9e4, 'a': 0.0, 'b': -1.0},
    'transverse': {'C': 300.0, 'a': 0.0, 'b': -3.0},
    'rotary': {'C': 150.0, 'a': 0.0, 'b': -1.0},
}


def some_grasps(robot, rng, count=12):
    """Return configurations, and objects in corners of them: apart, touched, pressed hard."""
    configs, centers, diameters = [], [], []
    while len(configs) < count:
        config, grasp, (b, b_end, c, c_end) = robots.random_grasp(robot, rng, rng.integers(99))
        center = complex(*grasp.center)
        sides = [(b_end - b) / abs(b_end - b), (c_end - c) / abs(c_end - c)]
        aside = [
            abs(((center - p) * s.conjugate()).imag) for p, s in zip((b, c), sides, strict=True)
        ]
        which = min(aside) if rng.random() < 0.5 else max(aside)
        diameter = 2.0 * (which + rng.uniform(-0.005, 0.02)) - robot.description.tube_diameter
        if diameter > 0.05 and which < min(aside) + 0.03:
            configs.append(config)
            centers.append(grasp.center)
            diameters.append(diameter)
    return configs, np.array(centers), np.array(diameters)


def batch(robot, configs, centers, diameters, **options):
    """Analyse them at once."""
    nodes = np.stack([config.nodes for config in configs])
    return analyze_grasps(robot, nodes, centers, diameters, **options)


def by_member(values, robot):
    """Return the numbers of all members, of a mapping that has those in contact."""
    spans = any(isinstance(value, tuple) for value in values.values())
    return [values.get(name, (np.nan, np.nan) if spans else 0.0) for name in robot.member_names]


def _largest(values):
    """Return the largest finite size of a number."""
    finite = np.abs(values)[np.isfinite(values)]
    return finite.max(initial=1e-3)


def assert_same(found, i, analysis, robot):
    """Compare one grasp, forces against all forces, stiffnesses against the largest."""
    force = 1e6 * analysis.closure_tolerance
    scale = {'closure_residual': force, 'closure_margin': force, 'normal_wrench': force}
    for field in fields(GraspAnalyses)[1:]:
        name, one = field.name, getattr(found, field.name)[i]
        value = getattr(analysis, name)
        if isinstance(value, dict):
            if name == 'contact_spans' and not value:
                assert np.isnan(one).all()
                continue
            value = np.array(by_member(value, robot))
            if name == 'utilisation_places':
                # Where hardly a moment is, rounding decides.
                loaded = found.utilisation[i] > 1e-9
                one, value = one[loaded], value[loaded]
        assert one == pytest.approx(
            value, rel=1e-8, abs=1e-9 * scale.get(name, _largest(one)), nan_ok=True
        ), name


@pytest.mark.parametrize('name', robots.PRESETS)
@pytest.mark.parametrize('options', [{}, {'friction': 1.2, 'external_wrenches': WRENCH}])
def test_numbers_are_those_of_one_by_one(name, options):
    robot = load_robot(name)
    configs, centers, diameters = some_grasps(robot, np.random.default_rng(4), 100)
    found = batch(robot, configs, centers, diameters, **options)
    assert found.errors == {}
    assert (found.contact_forces > 0.0).any(axis=1).sum() > 10
    given = {key.removesuffix('es'): value for key, value in options.items()}
    for i, (config, center, size) in enumerate(zip(configs, centers, diameters, strict=True)):
        analysis = analyze_grasp(config, Cylinder(center, size), flattening=False, **given)
        assert_same(found, i, analysis, robot)


@pytest.mark.parametrize('seed', range(6))
def test_numbers_of_random_robots_are_those_of_one_by_one(seed):
    rng = np.random.default_rng(seed)
    robot = robots.random_robot(seed)
    configs, centers, diameters = some_grasps(robot, rng, 5)
    mu, wrenches = rng.uniform(0.0, 1.5), rng.normal(size=(5, 3))
    pressure = {robot.topology.tube_names[0]: 4e4}
    found = batch(
        robot,
        configs,
        centers,
        diameters,
        friction=mu,
        external_wrenches=wrenches,
        spacing=0.01,
        pressure=pressure,
    )
    for i, config in enumerate(configs):
        cylinder = Cylinder(centers[i], diameters[i])
        analysis = analyze_grasp(
            config, cylinder, mu, wrenches[i], 'exact', 0.01, False, pressure=pressure
        )
        assert_same(found, i, analysis, robot)


def test_points_are_those_of_one_by_one():
    robot = load_robot('nine_member')
    configs, centers, diameters = some_grasps(robot, np.random.default_rng(6))
    middle = centers @ np.array([1.0, 1.0j])
    radius = 0.5 * (diameters + robot.description.tube_diameter)
    # Above a pinch point, points lie on the guide rings, 80 mm from there.
    home = robot.home
    ends = home.points[[robot.topology.b, robot.topology.c[robot.topology.following]]]
    above = ends + 0.1j * (ends[1] - ends[0]) / np.abs(ends[1] - ends[0])
    configs = configs + [home] * above.size
    middle, radius = np.append(middle, above), np.append(radius, np.full(above.size, 0.2))
    nodes = np.stack([config.points for config in configs]).T
    stack = frame_stack.FrameStack(robot, nodes, tube_pressures(robot.description, None))
    found = stack_points(stack, middle, radius, 0.01)
    for i, config in enumerate(configs):
        one = find_contact_points(structure_of(config), RoundSurface(middle[i], radius[i]), 0.01)
        own = found.grasp == i
        assert found.counts[i] == own.sum() == len(one.points)
        assert (found.member[own] == one.member).all()
        assert found.place[own] == pytest.approx(one.place)
        assert middle[i] + found.points[own] == pytest.approx(one.points)


@pytest.mark.parametrize(
    ('module', 'name', 'value'),
    [(frame_stack, 'SUSPICIOUS', 0.0), (contact_stack, 'MAX_STEPS', 0)],
)
def test_what_is_left_to_the_analysis_of_one_has_the_same_numbers(
    monkeypatch, module, name, value
):
    robot = load_robot('nine_member')
    case = some_grasps(robot, np.random.default_rng(7))
    together = batch(robot, *case)
    monkeypatch.setattr(module, name, value)
    alone = batch(robot, *case)
    for field in fields(GraspAnalyses)[1:]:
        one, other = getattr(together, field.name), getattr(alone, field.name)
        assert other == pytest.approx(one, rel=1e-7, abs=1e-8, nan_ok=True)


def test_most_grasps_are_computed_together(monkeypatch):
    robot = load_robot('nine_member')
    case = some_grasps(robot, np.random.default_rng(5), 60)
    calls = []
    module = 'isotruss_ros.core.grasping.analyze_grasps._analyze_alone'
    monkeypatch.setattr(module, lambda grasps, i, found: calls.append(i))
    batch(robot, *case)
    assert len(calls) < 6


def test_a_configuration_without_stiffness_has_an_error_and_spoils_no_other():
    document = robots.preset_document('triangle')
    document['tube']['stiffness'] = LAWS
    document['module']['guide_ring_distance'] = 0.25
    document['members']['min_length'] = 0.51
    robot = robots.load(document)
    good, short = robot.home, robot.configuration([-0.55, 0.0])
    assert short.member_lengths.min() < 2.0 * robot.description.module.guide_ring_distance
    found = batch(robot, [good, short, good], np.zeros((3, 2)), 0.3)
    assert list(found.errors) == [1]
    assert isinstance(found.errors[1], StructureError)
    assert not found.force_closure[1]
    assert np.isnan(found.stiffness[1]).all()
    assert_same(found, 2, analyze_grasp(good, Cylinder((0, 0), 0.3), flattening=False), robot)


def test_no_grasps_have_no_numbers():
    robot = load_robot('triangle')
    found = analyze_grasps(robot, np.zeros((0, len(robot.node_names), 2)), np.zeros((0, 2)), 0.3)
    assert found.stiffness.shape == (0, 3, 3)


@pytest.mark.parametrize(
    ('change', 'said'),
    [
        ({'nodes': np.zeros((2, 3, 2))}, 'nodes'),
        ({'nodes': 'many'}, 'nodes'),
        ({'centers': np.zeros((3, 2))}, 'centres'),
        ({'centers': [[0.0, 0.0], [np.nan, 0.0]]}, 'grasp 1'),
        ({'centers': [[0.0, 0.0], [1e12, 0.0]]}, 'grasp 1: the object .* must be within'),
        ({'diameters': [0.3, -0.1]}, "grasp 1: the object's diameter"),
        ({'diameters': [0.3, 1e-12]}, 'grasp 1: the object .* at least'),
        ({'diameters': [0.3, 0.3, 0.3]}, 'diameters'),
        ({'friction': -0.1}, 'friction'),
        ({'friction': np.inf}, 'friction'),
        ({'spacing': 1.0}, 'spacing'),
        ({'external_wrenches': [1.0, 0.0]}, 'wrenches'),
    ],
)
def test_unusable_arguments_are_refused_by_name(change, said):
    robot = load_robot('triangle')
    nodes = np.stack([robot.home.nodes, robot.home.nodes])
    usable = {'nodes': nodes, 'centers': np.zeros((2, 2)), 'diameters': 0.3}
    with pytest.raises(GraspError, match=said):
        analyze_grasps(robot, **(usable | change))


def test_objects_beyond_the_reach_of_all_tubes_touch_nothing_without_friction():
    robot = load_robot('triangle')
    nodes = robot.home.nodes[None]
    found = analyze_grasps(robot, nodes, np.zeros((1, 2)), 0.1, friction=0.0)
    analysis = analyze_grasp(robot.home, Cylinder((0, 0), 0.1), 0.0, flattening=False)
    assert_same(found, 0, analysis, robot)


def test_nodes_that_are_not_the_robots_are_refused():
    robot = load_robot('triangle')
    _, rods = np.split(robot.home_targets.lengths, [robot.topology.n_modules])
    near, off = (
        (1.0 + share * 1e-6 / rods.max()) * robot.home.nodes[None] for share in (0.99, 1.01)
    )
    assert not analyze_grasps(robot, near, np.zeros((1, 2)), 0.3).errors
    with pytest.raises(GraspError, match='grasp 0: nodes of module'):
        analyze_grasps(robot, off, np.zeros((1, 2)), 0.3)
    nodes = np.stack([robot.home.nodes, 1.01 * robot.home.nodes])
    with pytest.raises(GraspError, match='grasp 1: nodes of module'):
        analyze_grasps(robot, nodes, np.zeros((2, 2)), 0.3)
