# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Outdated pictures are those whose sources or words have changed."""

import importlib.util
from pathlib import Path
import re
import shutil
import sys

import pytest

TOP = Path(__file__).parents[2]
TOOL = Path('tools', 'pictures.py')


def load(folder, monkeypatch):
    """Return the tool of a folder as a module."""
    spec = importlib.util.spec_from_file_location('pictures', folder / TOOL)
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, 'pictures', module)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def pictures(monkeypatch, tmp_path):
    """Return the tool of a folder with one picture."""
    for folder in ('tools', 'docs/images'):
        (tmp_path / folder).mkdir(parents=True)
    shutil.copy(TOP / TOOL, tmp_path / TOOL)
    (tmp_path / 'robot.yaml').write_text('name: one\n')
    (tmp_path / 'draw.py').write_text('"""Draw."""\nopen("one.png", "w").write("1")\n')
    module = load(tmp_path, monkeypatch)
    module.PICTURES.clear()
    module.PICTURES['one'] = module.Picture(
        ('one.png',), ('draw.py',), ('draw.py', 'robot.yaml'), words=lambda: ['21 N, held']
    )
    return module


@pytest.mark.parametrize(
    ('name', 'text', 'is_outdated'),
    [
        ('draw.py', '"""Draw one."""\n# A comment.\nopen("one.png", "w").write("1")\n', False),
        ('draw.py', '"""Draw."""\nopen("one.png", "w").write("2")\n', True),
        ('robot.yaml', 'name: two\n', True),
    ],
)
def test_picture_is_outdated_by_a_changed_source(pictures, tmp_path, name, text, is_outdated):
    pictures.main([])
    (tmp_path / name).write_text(text)
    assert pictures.main(['--check']) == is_outdated


def test_every_picture_on_a_page_has_a_command(monkeypatch):
    drawn = {file for p in load(TOP, monkeypatch).PICTURES.values() for file in p.files}
    shown = {
        (page.parent / name).resolve().relative_to(TOP).as_posix()
        for page in (TOP / 'README.md', *TOP.glob('docs/*.md'), *TOP.glob('docs/*.rst'))
        for name in re.findall(r'(?:\]\(|image:: )([\w./]+\.(?:png|gif|svg))', page.read_text())
    }
    assert shown
    assert shown <= drawn
    assert all((TOP / file).exists() for file in drawn)
