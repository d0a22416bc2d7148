# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A type checker finds the package, installed and sees wrong types in user code."""

import pytest

WRONG = """
from isotruss_ros import core

robot = core.load_robot('nine_member')
held = core.settle_grasp(robot, core.ConvexObject.disc((0.7, 0.7), 0.3))
name: str = held.slip_margin
held.slip_marginn
reveal_type(core.solve_twist)
"""


def test_mypy_sees_wrong_types_in_user_code(tmp_path, monkeypatch):
    api = pytest.importorskip('mypy.api', reason='make test brings it')
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'mine.py').write_text(WRONG, encoding='utf-8')
    lines = api.run(['mine.py'])[0].splitlines()
    for number, words in (
        (
            5,
            'Argument 1 to "settle_grasp" has incompatible type "Robot"; expected "Configuration"',
        ),
        (6, 'expression has type "float", variable has type "str"'),
        (7, '"SettledGrasp" has no attribute "slip_marginn"'),
        (8, 'def (config: isotruss_ros.core.kinematics.configuration.Configuration'),
    ):
        assert [line for line in lines if line.startswith(f'mine.py:{number}:') and words in line]
