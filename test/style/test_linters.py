# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Linters of ament pass, and a type checker finds the types of the installed package."""

from pathlib import Path
import subprocess
import sys

import pytest

ROOT = Path(__file__).parents[2]
NOTICE = Path(__file__).read_text(encoding='utf-8').split('\n\n')[0]
BUILT = {'build', 'install', 'log', '_build'}
SOURCES = ['isotruss_ros', 'test', 'setup.py']
MISSING = 'needs it: use make test, or rosdep install'


@pytest.mark.flake8
@pytest.mark.linter
def test_flake8():
    pytest.importorskip('ament_flake8.main', reason=MISSING)
    program = 'import sys; from ament_flake8.main import main; sys.exit(main())'
    command = [sys.executable, '-c', program, *SOURCES]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.linter
@pytest.mark.pep257
def test_pep257():
    pep257 = pytest.importorskip('ament_pep257.main', reason=MISSING)
    assert pep257.main(argv=SOURCES) == 0, 'docstrings that differ from PEP 257 are listed above'


@pytest.mark.copyright
def test_source_files_begin_with_the_notice():
    for pattern in ('*.py', '*.sh'):
        for path in ROOT.rglob(pattern):
            parts = path.relative_to(ROOT).parts
            if BUILT.isdisjoint(parts) and not any(part.startswith('.') for part in parts):
                text = path.read_text(encoding='utf-8')
                first, _, rest = text.partition('\n')
                assert (rest if first.startswith('#!') else text).startswith(NOTICE), path


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
