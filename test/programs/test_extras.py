# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Without a package of an extra, or without ROS, commands and examples name the installation."""

from pathlib import Path
import subprocess
import sys

from isotruss_ros import executables, extras
from nightly import some_now
import pytest

ROOT = Path(__file__).parents[2]
#: Runs a command or file in a process in which no package beyond those of the core is installed.
CORE_ONLY = """
import pkgutil
import runpy
import sys

from isotruss_ros.extras import EXTRAS, ROS_PACKAGES

messages = {module.name for module in pkgutil.iter_modules() if module.name.endswith('_msgs')}
# An import of a module that is None raises ModuleNotFoundError.
sys.modules |= dict.fromkeys([*EXTRAS, *ROS_PACKAGES, *messages])
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name='__main__')
"""
#: What the error message of a command names; the others show their help with the core only.
NEEDED = {
    'plan_grasps': "'isotruss_ros[demo]'",
    'fit_tube_stiffness': "'isotruss_ros[demo]'",
    'sweep': "'isotruss_ros[sweep]'",
} | dict.fromkeys(['demo', 'view', *executables.REQUESTS, *executables.NODES], '`make venv`')
EXAMPLES = {
    'draw_grasp': "'isotruss_ros[demo]'",
    'grasp_map': "'isotruss_ros[demo]'",
    'optimise_grasp': "'isotruss_ros[demo]'",
    'tube_calibration': "'isotruss_ros[demo]'",
} | {path.stem: '`make venv`' for path in (ROOT / 'examples').glob('ros_*.py')}


def run_core_only(*arguments):
    """Return the completed process of a file with arguments, without extras and ROS."""
    command = [sys.executable, '-c', CORE_ONLY, *map(str, arguments)]
    return subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=120
    )


def assert_named(done, words):
    """Assert that a process ended with one line that contains the given words."""
    assert done.returncode == 1
    assert words in done.stderr
    assert len(done.stderr.splitlines()) == 1


#: A node and a request, which stand for all of their kind, a program with help, and one without.
DAILY = ('manipulation', 'move', 'calibrate_home', 'sweep')


@pytest.mark.parametrize(
    'name', some_now([*DAILY, *(p for p in executables.PROGRAMS if p not in DAILY)], len(DAILY))
)
def test_command_names_the_installation_of_a_missing_package(name):
    done = run_core_only(executables.__file__, name, '-h')
    if name in NEEDED:
        assert_named(done, NEEDED[name])
    else:
        assert done.returncode == 0
        assert 'usage' in done.stdout


@pytest.mark.parametrize('name', some_now(EXAMPLES))
def test_example_names_the_installation_of_a_missing_package(name):
    assert_named(run_core_only(ROOT / 'examples' / f'{name}.py'), EXAMPLES[name])


def test_missing_interfaces_beside_ros_are_explained_by_the_workspace():
    error = ModuleNotFoundError("No module named 'isotruss_msgs'", name='isotruss_msgs')
    assert 'ln -s isotruss_ros/msg_defs' in extras.explain_missing(error)
