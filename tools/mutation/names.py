# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Where the constants of a package are used."""

from __future__ import annotations

import ast
from collections.abc import Iterator
import functools
from pathlib import Path


def find_uses(package: Path, path: Path, line: int) -> set[tuple[str, int]]:
    """Return file names and lines of a package that use what a line outside of functions sets."""
    names, found = set(), {(path.name, number) for number in _body_at(_parse(path), line)}
    new = _names_at(_parse(path), line)
    while new:
        names |= new
        uses = {use for name in new for use in _loads(package).get(name, ())}
        found |= uses
        new = {other for at, number in uses for other in _names_at(_parse(package / at), number)}
        new -= names
    return found


@functools.cache
def _parse(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding='utf-8'))


@functools.cache
def _loads(package: Path) -> dict[str, set[tuple[str, int]]]:
    """Return where names, and attributes of that name, are read."""
    loads: dict[str, set[tuple[str, int]]] = {}
    for path in package.glob('*.py'):
        for node in ast.walk(_parse(path)):
            name = getattr(node, 'id', getattr(node, 'attr', None))
            if isinstance(name, str) and not isinstance(node.ctx, ast.Store):
                loads.setdefault(name, set()).add((path.name, node.lineno))
    return loads


def _names_at(tree: ast.Module | ast.ClassDef, line: int) -> set[str]:
    """Return the names that the statement of a module or class sets in a line."""
    for statement in tree.body:
        if statement.lineno <= line <= statement.end_lineno:
            if isinstance(statement, ast.ClassDef):
                return _names_at(statement, line)
            if isinstance(statement, ast.FunctionDef):
                # A default of an argument: what is used is the function.
                inside = line >= statement.body[0].lineno
                return set() if inside else {statement.name}
            return {name for target in _targets(statement) for name in _ids(target)}
    return set()


def _body_at(tree: ast.Module, line: int) -> set[int]:
    """Return the lines of the function of whose arguments a line sets a default."""
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    return {
        number
        for function in functions
        if function.lineno <= line < function.body[0].lineno
        for number in range(function.body[0].lineno, function.end_lineno + 1)
    }


def _targets(statement: ast.stmt) -> list[ast.expr]:
    single = getattr(statement, 'target', None)
    return [single] if single else getattr(statement, 'targets', [])


def _ids(target: ast.expr) -> Iterator[str]:
    for node in ast.walk(target):
        if isinstance(node, ast.Name):
            yield node.id
