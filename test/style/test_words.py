# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Summaries of docstrings name a quantity or an act."""

import ast
from pathlib import Path
import re

import pytest

PACKAGE = Path(__file__).parents[2] / 'isotruss_ros'
#: Packages whose words were read as a whole.
FOLDERS = (
    'core/model',
    'core/kinematics',
    'core/statics',
    'core/contact',
    'core/holding',
    'core/estimation',
    'core/manipulation',
    'core/numerics',
    'core/paths',
    'core/planning',
    'core/safety',
    'core/servo',
    'core/simulation',
    'calibration',
    'cli',
    'demo',
    'mujoco_plant',
    'nodes',
    'plotting',
    'viewer',
)
FILES = [path for folder in FOLDERS for path in sorted((PACKAGE / folder).rglob('*.py'))]
CLAUSE = re.compile(
    r'(?:Return|Returns|Yield|Tell|Say|Find|Compute|Give|Do|Take) '
    r'(?:what|how|whether or not|where|why|when|who|it|so|there|the same)\b'
)
FIRST = re.compile(r'(?:Of|By|That|What|How|Where|Who|When|Whether|Told|Seen|Be) ')
LAST = re.compile(r'\b(?:of|to|with|by|from|at|for|than)\.$')
ANTHROPOMORPHIC = re.compile(r'\b(?:tells?|believes?|believed|lies about|answers? to|sees)\b')
KINDS = (ast.Module, ast.ClassDef, ast.FunctionDef)


def summaries(tree):
    """Yield the names of definitions with the summaries of their docstrings."""
    for node in ast.walk(tree):
        text = ast.get_docstring(node) if isinstance(node, KINDS) else None
        if text:
            yield getattr(node, 'name', 'module'), text.split('\n\n')[0]


@pytest.mark.parametrize('path', FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_summaries_name_a_quantity_or_an_act(path):
    for name, summary in summaries(ast.parse(path.read_text(encoding='utf-8'))):
        for pattern in (CLAUSE, FIRST):
            assert not pattern.match(summary), (name, summary)
        for pattern in (LAST, ANTHROPOMORPHIC):
            assert not pattern.search(summary), (name, summary)
