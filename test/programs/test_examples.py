# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The examples run as they stand."""

import json
from pathlib import Path
import runpy

from nightly import some_now
import notebooks
import pytest

EXAMPLES = Path(__file__).parents[2] / 'examples'
#: The others run beside nodes: test/system/test_ros_examples.py.
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
    'follow_path': 'reached 0.26 mm off',
    'grasp_map': 'held with a slip margin of up to 4.4 N: see map.png',
    'grasps_in_processes': '200 of 200 hold the disc',
    'learning_loop': 'towards the goal: 0.9 mm from the goal at the end',
    'limits': 'too fast: slowed roller speed scale 0.476',
    'optimise_grasp': 'slip margin 4.11 N, utilisation 0.60, held: True',
    'own_optimiser': 'slip margin 1.21 N, then 3.17 N',
    'own_robot': "tall_triangle ('main/R', 'main/T') [0.687 1.168 1.168]",
    'pick_box': 'turned     (0.641, -0.303) m,  -14.0 degrees: held, slip margin 3.5 N',
    'plan_grasp': 'squeeze 17.2 N, slip margin 5.6 N',
    'roll_in_grip': 'now at [ 0.466 -0.233  0.2  ] ok',
    'settle_grasp': 'friction 0.8: held',
    'tube_calibration': '    membrane_modulus: 5.00000000e+04',
}


#: Each takes a second or more, or has processes of its own.
SLOW = {
    'chance_map',
    'grasp_map',
    'grasps_in_processes',
    'learning_loop',
    'optimise_grasp',
    'own_optimiser',
    'pick_box',
}


@pytest.mark.parametrize(
    'name', some_now(sorted(CORE_EXAMPLES, key=SLOW.__contains__), len(CORE_EXAMPLES) - len(SLOW))
)
def test_example_runs(name, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)  # where some write a picture
    runpy.run_path(str(EXAMPLES / f'{name}.py'), run_name='__main__')
    assert PRINTED[name] in capsys.readouterr().out.splitlines()


NOTEBOOK = Path(__file__).parents[2] / 'examples' / 'held_object.ipynb'


@pytest.fixture(scope='module')
def both():
    return json.loads(NOTEBOOK.read_text(encoding='utf-8')), notebooks.run(NOTEBOOK)


def outputs(notebook, kind):
    result = [output for cell in notebook['cells'] for output in cell.get('outputs', [])]
    return [output['data'].get(kind) if 'data' in output else output['text'] for output in result]


@pytest.mark.nightly
def test_notebook_prints_and_returns_its_saved_output(both):
    saved, run = both
    assert outputs(run, 'text/plain') == outputs(saved, 'text/plain')
    assert outputs(run, 'text/html') == outputs(saved, 'text/html')


@pytest.mark.nightly
def test_notebook_draws_the_held_object_and_a_map(both):
    _, run = both
    pictures = [png for png in outputs(run, 'image/png') if isinstance(png, str)]
    assert len(pictures) == 2
    assert all(len(picture) > 10_000 for picture in pictures)
