# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The examples run as they stand."""

from pathlib import Path
import runpy

import pytest

EXAMPLES = Path(__file__).parents[2] / 'examples'
#: The others run beside nodes: test/system/test_ros_examples.py.
CORE_EXAMPLES = sorted(p.stem for p in EXAMPLES.glob('*.py') if not p.stem.startswith('ros_'))
#: What each prints, beside whatever else.
PRINTED = {
    'analyze_box': 'push and turn the box',
    'analyze_grasp': 'closed by friction',
    'deform_under_load': 'T: ',
    'draw_grasp': 'the members press with 10.6 N: see drawing.png',
    'estimate_zeros': 'to be added: [5. 5. 5. 5. 5. 5.] mm',
    'failed_roller': 'failed: none: 3 independent motions left',
    'first_twist': 'south/P',
    'follow_path': 'REACHED',
    'grasps_in_processes': '200 of 200 hold the disc',
    'learning_loop': 'towards the goal: 0.',
    'limits': 'slowed roller speed',
    'optimise_grasp': 'utilisation 0.60, held: True',
    'own_optimiser': 'slip margin 2.6 N, then ',
    'own_robot': 'module.rod_length: -0.15: must be',
    'pick_box': 'turned     ',
    'plan_grasp': 'margin',
    'roll_in_grip': 'back within 1 um',
    'settle_grasp': 'friction 0.8: held',
    'tube_calibration': 'model: inflatable_beam',
}


def test_there_are_enough_and_each_is_short():
    assert len(CORE_EXAMPLES) >= 8
    for path in EXAMPLES.glob('*.py'):
        _, code = path.read_text(encoding='utf-8').split('\n\n', 1)  # below the notice
        limit = 60 if path.stem == 'learning_loop' else 40
        assert len(code.splitlines()) < limit, path


@pytest.mark.parametrize('name', CORE_EXAMPLES)
def test_example_runs(name, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)  # where some write a picture
    runpy.run_path(str(EXAMPLES / f'{name}.py'), run_name='__main__')
    assert PRINTED[name] in capsys.readouterr().out
