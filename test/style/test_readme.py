# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What the README and the pages of the documentation tell people to type works."""

from pathlib import Path
import re

import pytest

TOP = Path(__file__).parents[2]
README = (TOP / 'README.md').read_text(encoding='utf-8')
TEXTS = {
    path.relative_to(TOP).as_posix(): path.read_text(encoding='utf-8')
    for path in sorted([*TOP.glob('*.md'), *TOP.glob('docs/**/*.md')])
    if '_build' not in path.parts
}
MAKEFILE = (TOP / 'Makefile').read_text(encoding='utf-8')


def places(path):
    """Return where a path of a page may lead: from the top, or from the package."""
    return TOP / path, TOP / 'isotruss_ros' / path


def python_blocks(text):
    """Return the examples of a page; what cannot run alone is marked `py`."""
    return re.findall(r'```python\n(.*?)```', text, re.DOTALL)


def test_readme_is_short():
    assert len(README.splitlines()) <= 130


def test_python_example_of_the_readme_runs(capsys):
    (example,) = python_blocks(README)
    exec(compile(example, 'README.md', 'exec'), {})
    printed = capsys.readouterr().out
    # What is printed is what the comments say, as far as they go.
    shown = [line.removeprefix('# ') for line in example.splitlines() if line.startswith('# ')]
    for said, line in zip(shown, printed.splitlines(), strict=True):
        assert line.startswith(re.split(r', in |, \.\.\.', said)[0]), line


@pytest.mark.parametrize('page', [page for page, text in TEXTS.items() if python_blocks(text)])
def test_python_examples_of_the_pages_run(page, capsys):
    for example in python_blocks(TEXTS[page]):
        exec(compile(example, page, 'exec'), {})
        assert capsys.readouterr().out


@pytest.mark.parametrize('page', TEXTS)
def test_every_make_target_named_is_there(page):
    for target in re.findall(r'(?:`|^)make ([a-z]\w*)', TEXTS[page], re.MULTILINE):
        assert re.search(rf'^{target}:', MAKEFILE, re.MULTILINE), target


@pytest.mark.parametrize('page', TEXTS)
def test_links_lead_somewhere(page):
    for target in re.findall(r'\]\(([^)#:]+)[^):]*\)', TEXTS[page]):
        assert (TOP / page).parent.joinpath(target).exists(), target


@pytest.mark.parametrize('page', ['README.md', 'CONTRIBUTING.md', 'QUALITY_DECLARATION.md'])
def test_paths_named_are_there(page):
    named = re.findall(r'`((?:isotruss_ros/)?[\w.]+/[\w./]*)`', TEXTS[page])
    for path in named:
        if not path.startswith(('.venv', 'demo_output', 'docs/_build', 'geometry_msgs')):
            assert any(place.exists() for place in places(path)), path


def test_recipes_name_what_is_in_the_files():
    named = re.findall(r'`(\w+)` in\s+`([\w./]+)`', TEXTS['CONTRIBUTING.md'])
    assert len(named) > 3
    for name, path in named:
        (place,) = (place for place in places(path) if place.exists())
        assert re.search(rf'\b{name}\b', place.read_text(encoding='utf-8')), (name, path)
