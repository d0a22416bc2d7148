# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Docstrings of the public API document every parameter; ruff requires the summaries of all.

The public API is the exported names of the core and the protocols that users implement.
"""

import ast
from pathlib import Path
import re

from isotruss_ros import core

PACKAGE = Path(__file__).parents[2] / 'isotruss_ros'
#: Protocols and base classes that users implement.
PROTOCOLS = {'Barrier', 'Limit', 'Shape', 'SimulatedObject', 'TubeStiffness'}
DOCUMENTED = {*core.__all__, *PROTOCOLS}
FIELD = re.compile(r':(?:param|ivar) (\w+):')


def documented(node):
    """Return the names that a docstring documents."""
    return set(FIELD.findall(ast.get_docstring(node) or ''))


def parameters(function):
    """Return the names of parameters but for self, cls and private ones."""
    arguments = function.args
    given = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
    given += [one for one in (arguments.vararg, arguments.kwarg) if one is not None]
    return [one.arg for one in given if one.arg not in ('self', 'cls') and one.arg[0] != '_']


def is_setter(function):
    """Return whether a function is the setter of a property, which its getter documents."""
    return any(ast.unparse(one).endswith('.setter') for one in function.decorator_list)


def is_data(node):
    """Return whether a class is a data class or a named tuple, whose fields are parameters."""
    names = [ast.unparse(one) for one in (*node.decorator_list, *node.bases)]
    return any(name.startswith('dataclass') or name == 'NamedTuple' for name in names)


def refers_to_protocol(node):
    """Return whether a docstring refers to the protocol that documents the parameters."""
    return re.search(rf'see `[A-Z]\w+\.{node.name}`', ast.get_docstring(node) or '')


def fields(node, lines):
    """Return the fields of a data class that no comment beside or above them documents."""
    return [
        one.target.id
        for one in node.body
        if isinstance(one, ast.AnnAssign)
        and one.target.id[0] != '_'
        and 'ClassVar' not in ast.unparse(one.annotation)
        and '#: ' not in lines[one.lineno - 1]
        and not lines[one.lineno - 2].lstrip().startswith('#: ')
    ]


def undocumented(nodes, lines, prefix='', known=frozenset()):
    """Yield the parameters of the public API that are not documented."""
    for node in nodes:
        if not prefix and getattr(node, 'name', '') not in DOCUMENTED:
            continue
        if isinstance(node, ast.ClassDef):
            known_here = documented(node)
            given = fields(node, lines) if is_data(node) else []
            yield from (f'{node.name}: {name}' for name in given if name not in known_here)
            yield from undocumented(node.body, lines, f'{node.name}.', known_here)
        elif (
            isinstance(node, ast.FunctionDef)
            and (node.name == '__init__' or node.name[0] != '_')
            and not is_setter(node)
            and not refers_to_protocol(node)
        ):
            here = documented(node) | (known if node.name == '__init__' else set())
            yield from (
                f'{prefix}{node.name}: {name}' for name in parameters(node) if name not in here
            )


def test_every_parameter_of_the_public_api_is_documented():
    for path in sorted(PACKAGE.rglob('*.py')):
        text = path.read_text(encoding='utf-8')
        missing = list(undocumented(ast.parse(text).body, text.splitlines()))
        assert not missing, f'{path}: document {missing} by :param or :ivar, or by a comment "#: "'
