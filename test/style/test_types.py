# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A type checker finds the package, installed and sees wrong types in user code."""

import pytest

WRONG = """
from isotruss_ros import core

held = core.settle_grasp(core.load_robot('nine_member'), core.ConvexObject.disc((0.7, 0.7), 0.3))
held.slip_marginn
"""


@pytest.mark.nightly
def test_mypy_sees_wrong_types_in_user_code(tmp_path, monkeypatch):
    api = pytest.importorskip('mypy.api', reason='make test brings it')
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'mine.py').write_text(WRONG, encoding='utf-8')
    result = api.run(['mine.py'])[0]
    assert 'incompatible type "Robot"; expected "Configuration"' in result
    assert '"SettledGrasp" has no attribute "slip_marginn"' in result
