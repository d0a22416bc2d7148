# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Map the paper's equations to the core's functions by the tags "(1)" to "(20)" in the sources."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
import io
from pathlib import Path
import re
import tokenize

from ruamel.yaml import YAML

EQUATIONS = range(1, 21)
#: Link of a function to its file.
LINK = re.compile(r'\[`(core\.[\w.]+)`\]\(\.\./isotruss_ros/[\w/]+\.py\)')

HEAD = """\
<!-- Written by `make docs` from docs/_ext/paper_equations.yaml and the tags in the sources. -->
# Equations and functions

This page lists the equations of the paper. Below each equation are the functions whose docstring
or comments contain its number. The package computes some equations in a form that differs from the
printed one ([derivation](derivation.md))."""
#: Tag of an equation; a number after a name or a bracket is a call, not a tag.
TAG = re.compile(r'(?<![\w\])}])\((\d{1,2})\)')


@dataclass(frozen=True, order=True)
class Place:
    """
    Function, class or module that has the tag of an equation.

    :ivar module: dotted name of the module.
    :ivar name: name of the function or class in it; empty for the module.
    """

    module: str
    name: str


def equation_map(core: Path) -> dict[int, list[Place]]:
    """
    Return the places that compute each equation.

    A tag in a comment or in the summary of a docstring marks the place. For an equation without
    such a tag, the other text of docstrings counts; without that, docstrings of modules count.

    :param core: folder of the package `isotruss_ros.core`.
    """
    found: dict[int, dict[int, set[Place]]] = defaultdict(lambda: defaultdict(set))
    for path in sorted(core.rglob('*.py')):
        if path.name == '__init__.py':
            continue
        parts = path.relative_to(core.parents[1]).with_suffix('').parts
        for equation, rank, name in _tags(path.read_text(encoding='utf-8')):
            found[equation][rank].add(Place('.'.join(parts), name))
    return {n: sorted(ranks[min(ranks)]) for n, ranks in sorted(found.items())}


def _tags(source: str) -> Iterator[tuple[int, int, str]]:
    """Yield the equation, the rank (0 strongest, 2 weakest) and the place of each tag."""
    tree = ast.parse(source)
    definitions = list(_definitions(tree, ''))
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            line = token.start[0]
            names = [name for name, node in definitions if node.lineno <= line <= node.end_lineno]
            for equation in _numbers(token.string):
                yield equation, 0 if names else 2, names[-1] if names else ''
    for name, node in [('', tree), *definitions]:
        text = ast.get_docstring(node) or ''
        summary, _, rest = text.partition('\n\n')
        for equation in _numbers(summary):
            yield equation, 0 if name else 2, name
        for equation in _numbers(rest):
            yield equation, 1 if name else 2, name


def _definitions(node: ast.AST, prefix: str) -> Iterator[tuple[str, ast.AST]]:
    """Yield the functions and classes, outer ones first; a constructor counts as its class."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.ClassDef):
            name = prefix.rstrip('.') if child.name == '__init__' else prefix + child.name
            yield name, child
            yield from _definitions(child, f'{name}.')


def _numbers(text: str) -> set[int]:
    """Return the numbers of the equations in a text."""
    return {int(number) for number in TAG.findall(text)} & set(EQUATIONS)


def page(core: Path, statements: Path) -> str:
    """
    Return the page of equations: the statement of each, and the functions that compute it.

    Functions are linked to their files, which a code host can show. `link_reference` changes these
    links to the API reference.

    :param core: folder of the package.
    :param statements: YAML file with the statements of the equations, by part of the paper.
    """
    places = equation_map(core)
    parts = [HEAD]
    for part, equations in YAML(typ='safe').load(statements).items():
        parts.append(f'## {part}')
        for number, equation in equations.items():
            parts += [
                f'### ({number}) {equation["states"]}',
                f'```math\n{equation["latex"]}\n```',
                '\n'.join(f'- {_link(place)}' for place in places[number]),
            ]
    return '\n\n'.join(parts) + '\n'


def _link(place: Place) -> str:
    """Return a link from a page in docs/ to the file of a place."""
    name = f'{place.module}.{place.name}'.rstrip('.').removeprefix('isotruss_ros.')
    return f'[`{name}`](../{place.module.replace(".", "/")}.py)'


def link_reference(text: str) -> str:
    """
    Return a page whose links to functions lead to the API reference.

    :param text: page with links to files; links to private names, which the reference does not
        have, are removed.
    """

    def link(match: re.Match[str]) -> str:
        name = match[1]
        private = any(part.startswith('_') for part in name.split('.'))
        return f'`{name}`' if private else f'[`{name}`](#isotruss_ros.{name})'

    return LINK.sub(link, text)
