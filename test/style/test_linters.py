# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Linters of ament pass, and docstrings have parameters and summaries by the rules."""

import ast
from enum import Enum
import inspect
from pathlib import Path
import re
import subprocess
import sys

from isotruss_ros import core
from isotruss_ros.core.manipulation.limits import Limit
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.safety.barrier_law import Barrier
from isotruss_ros.core.simulation.simulated_robot import SimulatedObject
from isotruss_ros.core.statics.tube_stiffness import TubeStiffness
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


PROTOCOLS = (Barrier, Limit, Shape, SimulatedObject, TubeStiffness)
API = {thing.__name__: thing for thing in (*PROTOCOLS, *(getattr(core, n) for n in core.__all__))}
FIELD = re.compile(r':(?:param|ivar) (\w+):')
#: Fields with a comment "#: " above or beside them.
COMMENTED = re.compile(r'#: .*\n +(\w+):|^ +(\w+): [^#\n]*#: ', re.MULTILINE)


def parameters(function):
    """Return the names of public parameters of a function or constructor."""
    return {name for name in inspect.signature(function).parameters if name[0] != '_'} - {'self'}


def undocumented(thing):
    """Yield the parameters of a function, or of a class and its methods, without documentation."""
    texts = [inspect.getdoc(thing) or '']
    if inspect.isclass(thing):
        classes = [base for base in thing.__mro__ if base.__module__.startswith('isotruss_ros')]
        texts += [inspect.getdoc(part) or '' for base in classes for part in (base, base.__init__)]
        texts += [
            f':ivar {name}:'
            for base in classes
            for names in COMMENTED.findall(inspect.getsource(base))
            for name in filter(None, names)
        ]
        for name in (name for name in vars(thing) if name[0] != '_'):
            method = getattr(thing, name)
            if inspect.isfunction(method) or inspect.ismethod(method):
                yield from (f'{name}: {parameter}' for parameter in undocumented(method))
        if thing in PROTOCOLS or issubclass(thing, (Enum, Exception)):
            return
    elif re.search(rf'see `[A-Z]\w+\.{thing.__name__}`', texts[0]):
        return
    yield from parameters(thing) - {*FIELD.findall('\n'.join(texts))}


@pytest.mark.parametrize('name', API)
def test_every_parameter_of_the_public_api_is_documented(name):
    missing = list(undocumented(API[name]))
    assert not missing, f'{name}: document {missing} by :param or :ivar, or by a comment "#: "'


PACKAGE = Path(__file__).parents[2] / 'isotruss_ros'
#: Patterns that no summary has, and what to write instead.
RULES = {
    r'^(?:Return|Returns|Yield|Tell|Say|Find|Compute|Give|Do|Take) '
    r'(?:what|how|whether or not|where|why|when|who|it|so|there|the same)\b': (
        'its object is a clause or a pronoun: name the quantity'
    ),
    r'^(?:Of|By|That|What|How|Where|Who|When|Whether|Told|Seen|Be) ': (
        'it begins with a conjunction: begin with a noun, or with a verb in the imperative'
    ),
    r'\b(?:of|to|with|by|from|at|for|than)\.$': 'it ends with a preposition: name its object',
    r'\b(?:tells?|believes?|believed|lies about|answers? to|sees)\b': (
        'a thing does not believe, tell or see: use the term of the glossary'
    ),
}
KINDS = (ast.Module, ast.ClassDef, ast.FunctionDef)


def summaries(tree):
    """Yield the names of definitions with the summaries of their docstrings."""
    for node in ast.walk(tree):
        text = ast.get_docstring(node) if isinstance(node, KINDS) else None
        if text:
            yield getattr(node, 'name', 'module'), text.split('\n\n')[0]


def test_summaries_name_a_quantity_or_an_act():
    wrong = [
        f'{path.relative_to(PACKAGE)}: {name}: "{summary}": {remedy}'
        for path in sorted(PACKAGE.rglob('*.py'))
        for name, summary in summaries(ast.parse(path.read_text(encoding='utf-8')))
        for pattern, remedy in RULES.items()
        if re.search(pattern, summary)
    ]
    assert not wrong, '\n'.join(wrong)
