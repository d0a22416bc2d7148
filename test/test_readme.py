"""What the README and docs/ tell people to type works."""

from pathlib import Path
import re

from isotruss_ros.core import Status
from isotruss_ros.nodes import (
    grasp_analysis,
    grasp_planner,
    manipulation,
    parameters,
    path_follower,
    roller_trajectory,
    servo_settings,
    simulator,
    teleop,
)
import pytest

TOP = Path(__file__).parents[1]
README = (TOP / 'README.md').read_text(encoding='utf-8')


def test_python_example_runs(capsys):
    (example,) = re.findall(r'```python\n(.*?)```', README, re.DOTALL)
    exec(compile(example, 'README.md', 'exec'), {})
    printed = capsys.readouterr().out
    assert str(Status.OK) in printed
    assert 'north/Z' in printed


@pytest.mark.parametrize('page', sorted(p.name for p in TOP.glob('docs/*.md')))
def test_python_examples_of_the_pages_run(page, capsys):
    text = (TOP / 'docs' / page).read_text(encoding='utf-8')
    for example in re.findall(r'```python\n(.*?)```', text, re.DOTALL):
        exec(compile(example, page, 'exec'), {})
        assert capsys.readouterr().out


def test_every_make_target_named_is_there():
    makefile = (TOP / 'Makefile').read_text(encoding='utf-8')
    for target in re.findall(r'\bmake (\w+)', README):
        assert re.search(rf'^{target}:', makefile, re.MULTILINE), target


@pytest.mark.parametrize('page', ['README.md', *(f'docs/{p.name}' for p in TOP.glob('docs/*.md'))])
def test_links_lead_somewhere(page):
    text = (TOP / page).read_text(encoding='utf-8')
    for target in re.findall(r'\]\(([^)#:]+)\)', text):
        assert (TOP / page).parent.joinpath(target).exists(), target


def test_parameter_table_is_true():
    specs = [
        spec
        for module in (
            parameters,
            simulator,
            manipulation,
            grasp_analysis,
            grasp_planner,
            path_follower,
            roller_trajectory,
            servo_settings,
            teleop,
        )
        for spec in vars(module).values()
        if isinstance(spec, parameters.Spec)
    ]
    rows = [line for line in README.splitlines() if line.startswith('| `')]
    for spec in specs:
        (row,) = [row for row in rows if row.startswith(f'| `{spec.name}`')]
        shown = str(spec.default).lower()
        words = row.lower()
        assert (shown or "''") in words or (not shown and 'none' in words), (spec.name, row)


def test_every_test_that_a_page_names_is_there():
    named = [
        (page.name, *found)
        for page in TOP.glob('docs/*.md')
        for found in re.findall(r'(test_\w+)\.py::(test_\w+)', page.read_text(encoding='utf-8'))
    ]
    assert named
    for page, file, function in named:
        source = (TOP / 'test' / f'{file}.py').read_text(encoding='utf-8')
        assert f'def {function}(' in source, (page, file, function)
