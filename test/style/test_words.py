# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Summaries of docstrings name a quantity or an act by its standard term."""

import ast
from pathlib import Path
import re

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
