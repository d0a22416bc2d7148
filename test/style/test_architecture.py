# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Packages import only from those before them, and the core works without ROS."""

import ast
from pathlib import Path
import subprocess
import sys

from isotruss_ros import core
import pytest

ROOT = Path(__file__).parents[2]
#: In this order; packages that share a line do not import each other.
CORE = [
    ['core.errors'],
    ['core.numerics'],
    ['core.inputs'],
    ['core.model'],
    ['core.kinematics'],
    ['core.statics'],
    ['core.contact', 'core.fixed_object', 'core.manipulation'],
    ['core.holding'],
    ['core.chance', 'core.safety'],
    ['core.estimation', 'core.paths', 'core.planning'],
    ['core.servo'],
    ['core.simulation'],
    ['core'],
]
NODES = [
    ['nodes.grasp'],
    ['nodes.conversions'],
    ['nodes.framework'],
    [
        'nodes.bring_up',
        'nodes.manipulation',
        'nodes.pick_and_place',
        'nodes.simulator',
        'nodes.viewer',
    ],
    ['nodes'],
]
REST = [
    ['extras', 'workers'],
    ['mujoco_plant'],
    ['calibration'],
    ['plotting'],
    ['viewer'],
    *NODES,
    ['cli', 'demo'],
    ['executables'],
]
ORDER = {name: place for place, line in enumerate(CORE + REST) for name in line}
#: At the top of the sources only.
NOT_INSTALLED = {'studies', 'examples', 'test'}


def name_of(path):
    """Return the dotted name of a module under isotruss_ros."""
    parts = path.relative_to(ROOT / 'isotruss_ros').with_suffix('').parts
    return '.'.join(parts[:-1] if parts[-1] == '__init__' else parts)


FILES = {name_of(path): path for path in (ROOT / 'isotruss_ros').rglob('*.py')}


def package_of(module):
    """Return the package in the list that a module belongs to."""
    while module not in ORDER:
        module, _, last = module.rpartition('.')
        assert last, 'a package that is not in the list'
    return module


def imports(tree):
    """Return the modules of the package that a file imports, and what else it imports."""
    ours, others = set(), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found = [(alias.name, '') for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            found = [(node.module, alias.name) for alias in node.names]
        else:
            continue
        for module, name in found:
            top, _, inside = module.partition('.')
            if top != 'isotruss_ros':
                others.add(top)
                continue
            whole = f'{inside}.{name}'.strip('.')
            ours.add(whole if whole in FILES else inside)
    return ours, others


TREES = {module: ast.parse(path.read_text(encoding='utf-8')) for module, path in FILES.items()}
CORE_TREES = {module: tree for module, tree in TREES.items() if module.startswith('core')}
IMPORTS = {module: imports(tree) for module, tree in TREES.items() if module}


@pytest.mark.parametrize('module', sorted(IMPORTS))
def test_imports_only_from_packages_before_its_own(module):
    ours, others = IMPORTS[module]
    package = package_of(module)
    for imported in ours:
        other = package_of(imported)
        assert other == package or ORDER[other] < ORDER[package], f'{module} imports {imported}'
    assert not others & NOT_INSTALLED


def import_closure(package):
    """Return the modules that a package consists of or imports, directly and through others."""
    waiting = [module for module in IMPORTS if package_of(module) == package]
    found = set()
    while waiting:
        module = waiting.pop()
        if module not in found:
            found.add(module)
            waiting += IMPORTS[module][0] & IMPORTS.keys()
    return found


MECHANICS = ('model', 'kinematics', 'statics', 'contact', 'manipulation', 'holding', 'safety')
LOOPS = {'core.servo', 'core.estimation', 'core.paths'}


@pytest.mark.parametrize('package', [*MECHANICS, 'planning'])
def test_mechanics_and_planning_import_no_loop(package):
    assert not {package_of(module) for module in import_closure(f'core.{package}')} & LOOPS


HELD = ('holding', 'safety', 'estimation', 'servo', 'paths', 'planning')


@pytest.mark.parametrize('package', HELD)
def test_held_objects_import_nothing_of_the_analysis_of_a_fixed_object(package):
    packages = {package_of(module) for module in import_closure(f'core.{package}')}
    assert 'core.fixed_object' not in packages


def test_no_files_import_each_other():
    left = {module: ours - {module} for module, (ours, _) in IMPORTS.items()}
    while left:
        free = {module for module, ours in left.items() if not ours & left.keys()}
        assert free, f'a cycle through some of {sorted(left)}'
        left = {module: ours for module, ours in left.items() if module not in free}


PACKAGES = [path.parent for path in FILES.values() if path.stem == '__init__']


@pytest.mark.parametrize('package', sorted(PACKAGES)[1:], ids=lambda path: path.name)
def test_every_package_names_its_entry_points_and_imports(package):
    said = ast.get_docstring(ast.parse((package / '__init__.py').read_text(encoding='utf-8')))
    assert 'Entry point' in said
    assert 'Imports' in said


def test_objects_grips_and_barriers_are_closed_against_their_kinds():
    kinds = {'ConvexObject', 'Grip', 'Shape', 'Disc', 'Ellipse', 'Polygon', 'HeldGrip'}
    asked = [
        f'{module}:{call.lineno}'
        for module, tree in CORE_TREES.items()
        for call in ast.walk(tree)
        if isinstance(call, ast.Call) and getattr(call.func, 'id', '') == 'isinstance'
        for name in ast.walk(call.args[1])
        if getattr(name, 'id', '') in kinds or getattr(name, 'id', '').endswith('Barrier')
    ]
    assert not asked


def test_caches_of_frozen_classes_are_fields_or_results_of_functions():
    written = [
        f'{module}:{node.lineno}'
        for module, tree in CORE_TREES.items()
        for node in ast.walk(tree)
        for target in (getattr(node, 'value', None), getattr(node, 'func', None))
        if (getattr(target, 'attr', '') == '__dict__' and isinstance(node, ast.Subscript))
        or (
            getattr(getattr(target, 'value', None), 'attr', '') == '__dict__'
            and target.attr in {'update', 'setdefault', 'pop'}
        )
    ]
    assert not written


SCRIPT = """
import sys

blocked = ('rclpy', 'rcl_interfaces', 'std_msgs', 'geometry_msgs', 'sensor_msgs', 'isotruss_msgs',
           'builtin_interfaces', 'visualization_msgs', 'ament_index_python', 'rosidl_runtime_py')
for name in blocked:
    sys.modules[name] = None  # importing it raises ImportError

from isotruss_ros import core

assert 'jsonschema' not in sys.modules, 'the core imports it before a robot file is read'
for name in core.__all__:
    getattr(core, name)
robot = core.load_robot('nine_member')
center = core.tangent_center(robot.home, 'east/Q', 0.3)
grip = core.Grip.at_module(robot, 'east/Q', core.ConvexObject.disc(center, 0.3))
command = core.solve_twist(robot.home, grip, [0.0, 0.01, 0.0])
assert command.status is core.Status.OK, command
print(*sorted({name.split('.')[0] for name, module in sys.modules.items() if module}))
"""

#: A third of the time of an import of the core without them.
LATE = ('scipy.optimize', 'scipy.interpolate', 'scipy.special')
LOADING = """
import sys

from isotruss_ros import core

print(*sys.modules)
robot = core.load_robot('nine_member')
disc = core.ConvexObject.disc((0.6, 0.3), 0.3)
from isotruss_ros.core.servo.servo_settings import ServoSettings

grip = core.Grip.at_module(robot, 'east/Q', disc)
core.TwistServo(robot, ServoSettings(grip, period=0.005, timeout=0.1))
print(*sys.modules)
"""


def run(script):
    """Return what a script prints in a process of its own, in words by line."""
    done = subprocess.run(
        [sys.executable, '-c', script], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return [line.split() for line in done.stdout.splitlines()]


def test_there_are_few_names_at_the_top():
    assert len(core.__all__) <= 40


def test_core_works_without_ros():
    (loaded,) = run(SCRIPT)
    assert 'isotruss_ros' in loaded
    assert not [name for name in loaded if name.endswith('_msgs') or name.startswith('rcl')]


def test_a_control_loop_has_its_solver_before_it_begins():
    imported, ready = run(LOADING)
    assert not set(LATE) & set(imported)
    assert 'scipy.optimize' in ready
