# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What can be changed in a source file, and a source file with one change."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
import functools
from pathlib import Path
from types import CodeType
from typing import NamedTuple

SWAPPED = [(ast.Add, ast.Sub), (ast.Mult, ast.Div)]
#: Comparisons are reversed: of real numbers, < and <= differ only where nothing ever is.
SWAPPED += [(ast.Lt, ast.GtE), (ast.Gt, ast.LtE), (ast.Eq, ast.NotEq)]
CHANGES = dict(SWAPPED) | {new: old for old, new in SWAPPED}
CHANGES |= {ast.Pow: ast.Mult, ast.Mod: ast.Mult, ast.FloorDiv: ast.Mult, ast.USub: ast.UAdd}
SKIPPED_FIELDS = {'annotation', 'returns', 'slice', 'decorator_list'}
SKIPPED = (ast.Raise, ast.JoinedStr, ast.Assert, ast.Import, ast.ImportFrom)


class Site(NamedTuple):
    """A place that can be changed: its node, what changes, and the change."""

    node: ast.expr | ast.stmt
    words: str
    in_function: bool
    change: Callable[[], None]


class Mutant(NamedTuple):
    """A file whose site `index` is changed, its first and last line, and what changes."""

    path: Path
    index: int
    first: int
    last: int
    words: str
    in_function: bool

    @property
    def name(self) -> str:
        """Return what no other mutant of the package is called."""
        return f'{self.path.name}:{self.index}'

    @property
    def source(self) -> str:
        """Return the line that is changed."""
        return read_source(self.path).splitlines()[self.first - 1].strip()

    def compile_changed(self) -> CodeType:
        """Compile the changed file."""
        tree = ast.parse(read_source(self.path))
        list(find_sites(tree))[self.index].change()
        return compile(tree, str(self.path), 'exec')


@functools.cache
def read_source(path: Path) -> str:
    """Read a file once: mutants are those of the files as they were at first."""
    return path.read_text(encoding='utf-8')


def find_mutants(path: Path) -> list[Mutant]:
    """Return all mutants of a file."""
    sites = find_sites(ast.parse(read_source(path)))
    return [
        Mutant(path, i, site.node.lineno, site.node.end_lineno, site.words, site.in_function)
        for i, site in enumerate(sites)
    ]


def find_sites(
    node: ast.AST, arithmetic: bool = False, in_function: bool = False
) -> Iterator[Site]:
    """Yield what can be changed; whole numbers where they are operands of arithmetic."""
    operand = getattr(node, 'op', None)
    if isinstance(node, ast.BinOp | ast.AugAssign | ast.UnaryOp) and type(operand) in CHANGES:
        new = CHANGES[type(operand)]()
        words = f'{type(operand).__name__} -> {type(new).__name__}'
        yield Site(node, words, in_function, lambda: setattr(node, 'op', new))
    if isinstance(node, ast.Compare):
        for at, old in enumerate(node.ops):
            if type(old) in CHANGES:
                yield _reverse(node, at, CHANGES[type(old)](), in_function)
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        value = node.value + 1
        if isinstance(node.value, float):
            # Up or down, by the place in the line.
            value = node.value * (1.1 if node.col_offset % 2 else 0.9) or 0.1
        if isinstance(node.value, float) or arithmetic:
            words = f'{node.value!r} -> {value!r}'
            yield Site(node, words, in_function, lambda: setattr(node, 'value', value))
    for name, field in ast.iter_fields(node):
        if name in SKIPPED_FIELDS:
            continue
        # Defaults of arguments are computed outside.
        inside = name == 'body' and isinstance(node, ast.FunctionDef | ast.Lambda)
        for child in field if isinstance(field, list) else [field]:
            if isinstance(child, ast.AST) and not isinstance(child, SKIPPED):
                of_arithmetic = isinstance(node, ast.BinOp | ast.AugAssign)
                yield from find_sites(child, of_arithmetic, in_function or inside)


def _reverse(node: ast.Compare, at: int, new: ast.cmpop, in_function: bool) -> Site:
    words = f'{type(node.ops[at]).__name__} -> {type(new).__name__}'
    return Site(node, words, in_function, lambda: node.ops.__setitem__(at, new))
