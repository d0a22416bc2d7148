# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where the core computes the equations of the paper: the tags "(1)" to "(20)" in its sources."""

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
#: The link of a function to its file.
LINK = re.compile(r'\[`(core\.[\w.]+)`\]\(\.\./isotruss_ros/[\w/]+\.py\)')

HEAD = """\
<!-- Written by `make docs` from docs/_ext/paper_equations.yaml and the tags in the sources. -->
# Equations and functions

The equations of the paper, and the functions that compute each, by tags in the sources. Some are
solved in another form than they are printed: [derivation](derivation.md)."""
#: Not what follows a name or a bracket: that is a call.
TAG = re.compile(r'(?<![\w\])}])\((\d{1,2})\)')


@dataclass(frozen=True, order=True)
class Place:
    """
    A function, class or module that has the tag of an equation.

    :ivar module: dotted name.
    :ivar name: of the function or class in it; empty for the module.
    """

    module: str
    name: str


def equation_map(core: Path) -> dict[int, list[Place]]:
    """
    Return where each equation is computed.

    A comment with the tag, or a docstring whose summary has it, marks what computes an equation.
    Only where an equation has neither, longer docstrings count, and then those of modules.

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
    """Yield the equation, how weakly it is claimed (0 to 2), and the function or class."""
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
    """Return the equations that a text names."""
    return {int(number) for number in TAG.findall(text)} & set(EQUATIONS)


def page(core: Path, statements: Path) -> str:
    """
    Return the page of equations: what each states, and the functions that compute it.

    Functions link to their files, which is what a code host can show; `link_reference` makes them
    links to the reference.

    :param core: folder of the package.
    :param statements: YAML file with the equations of the paper, by the part that they belong to.
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
    """Return a link to the file of a place, seen from a page in docs/."""
    name = f'{place.module}.{place.name}'.rstrip('.').removeprefix('isotruss_ros.')
    return f'[`{name}`](../{place.module.replace(".", "/")}.py)'


def link_reference(text: str) -> str:
    """
    Return a page whose links to functions lead to the reference of the site.

    :param text: page with links to files. Private names, which the reference lacks, lose theirs.
    """

    def link(match: re.Match[str]) -> str:
        name = match[1]
        private = any(part.startswith('_') for part in name.split('.'))
        return f'`{name}`' if private else f'[`{name}`](#isotruss_ros.{name})'

    return LINK.sub(link, text)
