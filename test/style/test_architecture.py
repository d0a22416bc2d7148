# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Packages are imported in the order of CONTRIBUTING.md; the core works without ROS."""

import ast
import functools
from pathlib import Path
import re
import subprocess
import sys

from isotruss_ros import core

ROOT = Path(__file__).parents[2]
CONTRIBUTING = (ROOT / 'CONTRIBUTING.md').read_text(encoding='utf-8')
(LISTED,) = re.findall(r'### Order of packages\n.*?```text\n(.*?)```', CONTRIBUTING, re.DOTALL)
#: Packages on one line do not import each other.
ORDER = {name: place for place, line in enumerate(LISTED.splitlines()) for name in line.split()}
NOT_INSTALLED = {'studies', 'examples', 'test'}


def name_of(path):
    """Return the dotted name of a module under isotruss_ros."""
    parts = path.relative_to(ROOT / 'isotruss_ros').with_suffix('').parts
    return '.'.join(parts[:-1] if parts[-1] == '__init__' else parts)


FILES = {name_of(path): path for path in (ROOT / 'isotruss_ros').rglob('*.py')}


def package_of(module):
    package = module
    while package not in ORDER:
        package, _, last = package.rpartition('.')
        assert last, f'{module}: add its package to the order of packages in CONTRIBUTING.md'
    return package


def imports(tree):
    """Return the modules of the package that a file imports, and the names of other packages."""
    ours, others = set(), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            pairs = [(alias.name, '') for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            pairs = [(node.module, alias.name) for alias in node.names]
        else:
            continue
        for module, name in pairs:
            top, _, inside = module.partition('.')
            if top != 'isotruss_ros':
                others.add(top)
                continue
            whole = f'{inside}.{name}'.strip('.')
            ours.add(whole if whole in FILES else inside)
    return ours, others


@functools.cache
def find_imports():
    """Return `imports` of each module by its name."""
    texts = {name: path.read_text(encoding='utf-8') for name, path in FILES.items() if name}
    return {name: imports(ast.parse(text)) for name, text in texts.items()}


def test_modules_import_their_own_package_and_packages_above_it():
    wrong = [
        f'{module} imports {imported}, whose package is not above its own in CONTRIBUTING.md'
        for module, (ours, _) in find_imports().items()
        for imported in ours
        if package_of(imported) != package_of(module)
        and ORDER[package_of(imported)] >= ORDER[package_of(module)]
    ]
    assert not wrong


def test_modules_import_only_packages_that_are_installed():
    wrong = {module: others & NOT_INSTALLED for module, (_, others) in find_imports().items()}
    assert not {module: names for module, names in wrong.items() if names}


def test_modules_do_not_import_each_other_in_a_circle():
    left = {module: ours - {module} for module, (ours, _) in find_imports().items()}
    while left:
        free = {module for module, ours in left.items() if not ours & left.keys()}
        assert free, f'a circle of some of {sorted(left)}'
        left = {module: ours for module, ours in left.items() if module not in free}


def test_only_tests_of_the_studies_import_them():
    importing = {
        path.name
        for path in ROOT.glob('test/**/*.py')
        if 'studies' in imports(ast.parse(path.read_text(encoding='utf-8')))[1]
    }
    assert importing == {'test_paper.py', 'test_regulated_carry.py'}


def test_reference_lists_the_packages_of_the_core_in_their_order():
    page = (ROOT / 'docs' / 'api.md').read_text(encoding='utf-8')
    packages = [f'core.{name}' for name in re.findall(r'^api/(\w+)$', page, re.MULTILINE)]
    assert packages == [name for name in ORDER if name.startswith('core.')]
    assert all(name in FILES for name in ORDER)


SCRIPT = """
import sys

blocked = ('rclpy', 'rcl_interfaces', 'std_msgs', 'geometry_msgs', 'sensor_msgs', 'isotruss_msgs',
           'builtin_interfaces', 'visualization_msgs', 'ament_index_python', 'rosidl_runtime_py')
for name in blocked:
    sys.modules[name] = None  # importing it raises ImportError

from isotruss_ros import core

for name in core.__all__:
    getattr(core, name)
print(*sys.modules)
robot = core.load_robot('nine_member')
center = core.tangent_center(robot.home, 'east/Q', 0.3)
grip = core.Grip.at_module(robot, 'east/Q', core.ConvexObject.disc(center, 0.3))
command = core.solve_twist(robot.home, grip, [0.0, 0.01, 0.0])
assert command.status is core.Status.OK, command
print(*(name for name, module in sys.modules.items() if module))
"""
#: Modules that a third of the time of an import of the core would be spent on.
LATE = {'jsonschema', 'scipy.optimize', 'scipy.interpolate', 'scipy.special'}
LOADING = """
import sys

from isotruss_ros import core
from isotruss_ros.core.servo.servo_settings import ServoSettings

robot = core.load_robot('nine_member')
grip = core.Grip.at_module(robot, 'east/Q', core.ConvexObject.disc((0.6, 0.3), 0.3))
core.TwistServo(robot, ServoSettings(grip, period=0.005, timeout=0.1))
print(*sys.modules)
"""


HELPS = """
import contextlib
import io
import sys

from isotruss_ros import executables, extras

sys.modules |= dict.fromkeys(['scipy', *extras.EXTRAS])  # importing them raises ImportError
for name in ('', *executables.REQUESTS, *executables.PROGRAMS):
    sys.argv = ['isotruss', *([name] if name else []), '--help']
    text = io.StringIO()
    with contextlib.redirect_stdout(text), contextlib.suppress(SystemExit, ImportError):
        executables.isotruss()
    if not text.getvalue().startswith(f'usage: isotruss {name}'.rstrip()):
        print(name or 'isotruss')
"""


def printed_names(script):
    """Return the names on each line that a script prints in a process of its own."""
    done = subprocess.run([sys.executable, '-c', script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return [set(line.split()) for line in done.stdout.splitlines()]


def test_core_works_without_ros_and_is_imported_without_slow_modules():
    imported, used = printed_names(SCRIPT)
    assert not imported & LATE
    tops = {name.partition('.')[0] for name in used}
    assert not [name for name in tops if name.endswith('_msgs') or name.startswith('rcl')]


def test_help_of_every_command_imports_no_scipy_and_no_optional_package():
    assert not printed_names(HELPS)


def test_analysis_of_the_paper_loads_without_the_packages_that_it_does_not_import():
    (loaded,) = printed_names(
        'import sys; from isotruss_ros import core; core.analyze_grasp; print(*sys.modules)'
    )
    packages = {name.split('.')[2] for name in loaded if name.startswith('isotruss_ros.core.')}
    below = {'errors', 'numerics', 'inputs', 'model', 'kinematics', 'statics'}
    assert packages <= {*below, 'fixed_object'}


def test_twist_servo_has_loaded_its_solver_before_the_first_cycle():
    (loaded,) = printed_names(LOADING)
    assert 'scipy.optimize' in loaded


def test_public_api_has_at_most_40_names():
    assert len(core.__all__) <= 40, 'import a special name from its package instead'
