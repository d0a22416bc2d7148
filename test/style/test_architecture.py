# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A package imports only from those before it in the list, and no two files import each other."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
#: In this order; packages that share a line do not import each other.
CORE = [
    ['core.errors'],
    ['core.numerics'],
    ['core.model'],
    ['core.kinematics'],
    ['core.statics'],
    ['core.contact', 'core.manipulation'],
    ['core.holding'],
    ['core.safety'],
    ['core.control'],
    ['core.planning'],
    ['core.simulation'],
    ['core'],
]
NODES = [['nodes.framework'], ['nodes.conversions'], ['nodes.components'], ['nodes']]
REST = [
    ['mujoco_plant'],
    ['calibration'],
    ['plotting'],
    ['viewer'],
    *NODES,
    ['cli', 'demo'],
    ['executables'],
]
ORDER = {name: place for place, line in enumerate(CORE + REST) for name in line}
#: At the top of the sources only.
NOT_INSTALLED = {'comparison', 'paper', 'examples', 'benchmarks', 'test'}


def name_of(path):
    """Return the dotted name of a module under isotruss_ros."""
    parts = path.relative_to(ROOT / 'isotruss_ros').with_suffix('').parts
    return '.'.join(parts[:-1] if parts[-1] == '__init__' else parts)


FILES = {name_of(path): path for path in (ROOT / 'isotruss_ros').rglob('*.py')}


def package_of(module):
    """Return the package in the list that a module belongs to."""
    while module not in ORDER:
        module, _, last = module.rpartition('.')
        assert last, 'a package that is not in the list'
    return module


def imports(path):
    """Return the modules of the package that a file imports, and what else it imports."""
    ours, others = set(), set()
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            found = [(alias.name, '') for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            found = [(node.module, alias.name) for alias in node.names]
        else:
            continue
        for module, name in found:
            top, _, inside = module.partition('.')
            if top != 'isotruss_ros':
                others.add(top)
                continue
            whole = f'{inside}.{name}'.strip('.')
            ours.add(whole if whole in FILES else inside)
    return ours, others


IMPORTS = {module: imports(path) for module, path in FILES.items() if module}


@pytest.mark.parametrize('module', sorted(IMPORTS))
def test_imports_only_from_packages_before_its_own(module):
    ours, others = IMPORTS[module]
    package = package_of(module)
    for imported in ours:
        other = package_of(imported)
        assert other == package or ORDER[other] < ORDER[package], f'{module} imports {imported}'
    assert not others & NOT_INSTALLED


def test_no_files_import_each_other():
    left = {module: ours - {module} for module, (ours, _) in IMPORTS.items()}
    while left:
        free = {module for module, ours in left.items() if not ours & left.keys()}
        assert free, f'a cycle through some of {sorted(left)}'
        left = {module: ours for module, ours in left.items() if module not in free}
