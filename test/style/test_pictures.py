# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The hashes by which pictures are found out of date."""

import importlib.util
from pathlib import Path
import re
import sys

import pytest

TOP = Path(__file__).parents[2]
SPEC = importlib.util.spec_from_file_location('pictures', TOP / 'tools' / 'pictures.py')


@pytest.fixture
def pictures(monkeypatch, tmp_path):
    """Return the module, with sources of its own that draw one picture."""
    module = importlib.util.module_from_spec(SPEC)
    monkeypatch.setitem(sys.modules, 'pictures', module)
    SPEC.loader.exec_module(module)
    monkeypatch.setattr(module, 'TOP', tmp_path)
    monkeypatch.setattr(module, 'HASHES', tmp_path / 'inputs.json')
    own = module.Picture(
        ('one.png',), ('draw.py',), ('draw.py', 'robot.yaml'), words=lambda: list(module.today)
    )
    module.today = ['21 N, held']
    monkeypatch.setattr(module, 'PICTURES', {'one': own})
    (tmp_path / 'robot.yaml').write_text('name: one\n')
    (tmp_path / 'draw.py').write_text('"""Draw."""\nopen("one.png", "w").write("1")\n')
    return module


def test_a_picture_is_made_once(pictures, capsys):
    assert pictures.main(['--check']) == 1
    assert capsys.readouterr().err == 'one.png: not there: make pictures\n'
    assert pictures.main([]) == 0
    assert pictures.main(['--check']) == 0


@pytest.mark.parametrize(
    ('name', 'text', 'stale'),
    [
        ('draw.py', '"""Draw one."""\n# A comment.\nopen("one.png", "w").write("1")\n', False),
        ('draw.py', '"""Draw."""\nopen("one.png", "w").write("2")\n', True),
        ('robot.yaml', 'name: two\n', True),
    ],
)
def test_a_picture_is_out_of_date_where_what_draws_it_changed(
    pictures, tmp_path, name, text, stale
):
    pictures.main([])
    (tmp_path / name).write_text(text)
    assert pictures.main(['--check']) == stale


def test_a_comment_of_a_message_makes_no_recording_outdated(pictures, tmp_path):
    file = tmp_path / 'Grasp.msg'
    hashes = []
    for text in ('# Code.\nuint8 code\n', 'uint8 code  # code\n', 'uint8 result\n'):
        file.write_text(text)
        hashes.append(pictures.hash_inputs(['Grasp.msg']))
    assert hashes[0] == hashes[1] != hashes[2]


def test_every_picture_of_readme_and_pages_is_made_by_a_command():
    module = importlib.util.module_from_spec(SPEC)
    sys.modules['pictures'] = module
    SPEC.loader.exec_module(module)
    made = {file for picture in module.PICTURES.values() for file in picture.files}
    pages = [TOP / 'README.md', *(TOP / 'docs').glob('*.md'), *(TOP / 'docs').glob('*.rst')]
    shown = set()
    for page in pages:
        for found in re.findall(r'(?:\]\(|image:: )([\w./]+\.(?:png|gif|svg))', page.read_text()):
            shown.add((page.parent / found).resolve().relative_to(TOP).as_posix())
    assert shown
    assert shown <= made
    assert all((TOP / file).exists() for file in made)
