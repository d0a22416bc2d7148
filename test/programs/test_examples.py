# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Examples and commands, as they stand, and without a package of an extra or without ROS."""

import json
import os
from pathlib import Path
import runpy
import site
import subprocess
import sys

from isotruss_ros import executables, extras
from nightly import some_now
import notebooks
import pytest

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / 'examples'
#: The others run beside nodes: test/system/test_demo_processes.py.
CORE_EXAMPLES = sorted(p.stem for p in EXAMPLES.glob('*.py') if not p.stem.startswith('ros_'))
#: A line that each prints, beside others: the same on every processor.
PRINTED = {
    'analyze_box': 'north/P-Z presses with 12.3 N over 25 mm',
    'analyze_grasp': '62 contact points, 13.0 N in all',
    'chance_map': 'largest chance 0.85, at the largest slip margin 0.72',
    'deform_under_load': 'T: 1.09 mm, -4.01 mm, 0.0000 rad',
    'draw_grasp': 'the members press with 13.0 N: see drawing.png',
    'estimate_roller_offsets': 'to be added: [4.4 5.  4.5 4.8 4.3 5.2] mm',
    'failed_roller': 'failed: none: 3 independent motions left',
    'first_twist': 'south/P  -0.0033 m/s',
    'fit_slip_margin': 'fitted to 873 held discs, compared with settle_grasps for 292',
    'follow_path': 'reached 0.26 mm off',
    'grasp_map': 'held with a slip margin of up to 4.4 N: see map.png',
    'grasps_in_processes': '200 of 200 hold the disc',
    'learning_loop': 'to the goal: 0.6 mm from the goal at the end',
    'learn_to_carry': 'generation  lost  distance of the others from the goal',
    'limits': 'too fast: slowed roller speed scale 0.476',
    'optimise_grasp': 'slip margin 4.11 N, utilisation 0.60, held: True',
    'own_optimiser': 'slip margin 1.21 N, then 3.17 N',
    'own_robot': "tall_triangle ('main/R', 'main/T') [0.687 1.168 1.168]",
    'pick_box': 'turned     (0.641, -0.303) m,  -14.0 degrees: held, slip margin 3.5 N',
    'plan_grasp': 'squeeze 17.2 N, slip margin 5.6 N',
    'plan_path': '3 poses lead around the post',
    'roll_in_grip': 'now at [ 0.466 -0.233  0.2  ] ok',
    'settle_grasp': 'friction 0.8: held',
    'tube_calibration': '    membrane_modulus: 5.00000000e+04',
}
#: Each takes a second or more, or has processes of its own.
SLOW = {
    'chance_map',
    'fit_slip_margin',
    'grasp_map',
    'grasps_in_processes',
    'learn_to_carry',
    'learning_loop',
}
SLOW |= {'optimise_grasp', 'own_optimiser', 'pick_box', 'plan_path'}


@pytest.mark.parametrize(
    'name', some_now(sorted(CORE_EXAMPLES, key=SLOW.__contains__), len(CORE_EXAMPLES) - len(SLOW))
)
def test_example_runs(name, capsys, monkeypatch, tmp_path):
    if name in {'learn_to_carry', 'learning_loop'}:
        pytest.importorskip('gymnasium', reason='needs the extra learning')
    monkeypatch.chdir(tmp_path)  # where some write a picture
    runpy.run_path(str(EXAMPLES / f'{name}.py'), run_name='__main__')
    assert PRINTED[name] in capsys.readouterr().out.splitlines()


#: Number of figures of each notebook.
FIGURES = {'paper': 3, 'held_object': 2}


def outputs(notebook, kind):
    result = [output for cell in notebook['cells'] for output in cell.get('outputs', [])]
    return [output['data'].get(kind) if 'data' in output else output['text'] for output in result]


@pytest.mark.parametrize('name', some_now(FIGURES))
def test_notebook_has_its_saved_output_and_draws_its_figures(name):
    path = EXAMPLES / f'{name}.ipynb'
    saved, run = json.loads(path.read_text(encoding='utf-8')), notebooks.run(path)
    for kind in ('text/plain', 'text/html'):
        assert outputs(run, kind) == outputs(saved, kind)
    pictures = [len(png) for png in outputs(run, 'image/png') if isinstance(png, str)]
    assert len(pictures) == FIGURES[name]
    assert min(pictures) > 10_000
    printed = {line for lines in outputs(run, 'text/plain') for line in lines}
    equations = {f'({number}) agrees with the package\n' for number in range(1, 21)}
    assert name != 'paper' or equations <= printed


@pytest.fixture(scope='module')
def jupyter(tmp_path_factory):
    """Return an environment on top of this one after `pip install notebook`."""
    folder = tmp_path_factory.mktemp('jupyter')
    subprocess.run([sys.executable, '-m', 'venv', '--without-pip', folder], check=True)
    packages = [folder / 'lib' / f'python3.{sys.version_info.minor}' / 'site-packages']
    (packages[0] / 'below.pth').write_text(
        ''.join(
            f'import site; site.addsitedir({path!r})\n'
            for path in (*site.getsitepackages(), str(ROOT))
        ),
        encoding='utf-8',
    )
    pip = [sys.executable, '-m', 'pip', '--python', folder / 'bin' / 'python', 'install']
    subprocess.run([*pip, '--quiet', '--disable-pip-version-check', 'notebook'], check=True)
    return folder / 'bin'


@pytest.mark.nightly
@pytest.mark.parametrize('name', FIGURES)
def test_notebook_draws_its_figures_in_jupyter(name, jupyter, tmp_path):
    execute = [jupyter / 'python', '-m', 'jupyter', 'nbconvert', '--execute', '--to', 'notebook']
    subprocess.run(
        [*execute, '--output-dir', tmp_path, EXAMPLES / f'{name}.ipynb'],
        check=True,
        env=os.environ | {'PATH': f'{jupyter}:{os.environ["PATH"]}'},
    )
    run = json.loads((tmp_path / f'{name}.ipynb').read_text(encoding='utf-8'))
    assert sum(isinstance(png, str) for png in outputs(run, 'image/png')) == FIGURES[name]


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
#: Arguments with which a command begins; all of them show their help with the core only.
BEGUN = {
    'plan_grasps': '--center 0.5 0.3 --diameter 0.3',
    'fit_tube_stiffness': 'points.csv',
    'grasp_dataset': 'triangle --count 1 --out grasps.npz',
    'sweep': 'triangle --objects objects.csv --output grasps.csv',
    'demo': '',
    'view': '',
}
#: What the error message of a command names that begins.
NEEDED = {
    'plan_grasps': "'isotruss_ros[demo]'",
    'fit_tube_stiffness': "'isotruss_ros[demo]'",
    'grasp_dataset': "'isotruss_ros[demo]'",
    'sweep': "'isotruss_ros[sweep]'",
} | dict.fromkeys(['demo', 'view', *executables.REQUESTS, *executables.NODES], '`make venv`')
NEEDED_BY_EXAMPLES = {
    'draw_grasp': "'isotruss_ros[demo]'",
    'grasp_map': "'isotruss_ros[demo]'",
    'learning_loop': "'isotruss_ros[learning]'",
    'optimise_grasp': "'isotruss_ros[demo]'",
    'tube_calibration': "'isotruss_ros[demo]'",
} | {path.stem: '`make venv`' for path in EXAMPLES.glob('ros_*.py')}


def run_core_only(*arguments):
    """Return the completed process of a file with arguments, without extras and ROS."""
    command = [sys.executable, '-c', CORE_ONLY, *map(str, arguments)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)


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
    done = run_core_only(executables.__file__, name, *BEGUN.get(name, '-h').split())
    if name in NEEDED:
        assert_named(done, NEEDED[name])
    else:
        assert done.returncode == 0
        assert 'usage' in done.stdout


@pytest.mark.parametrize('name', some_now(NEEDED_BY_EXAMPLES))
def test_example_names_the_installation_of_a_missing_package(name):
    assert_named(run_core_only(EXAMPLES / f'{name}.py'), NEEDED_BY_EXAMPLES[name])


def test_missing_interfaces_beside_ros_are_explained_by_the_workspace():
    error = ModuleNotFoundError("No module named 'isotruss_msgs'", name='isotruss_msgs')
    assert 'ln -s isotruss_ros/msg_defs' in extras.explain_missing(error)
