# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Report of sizes, structure, calls and tests, beside the figures of the last release.

    python tools/measure.py [--store VERSION]

No test bounds these figures. Lines of code are those without blank lines and comments.
"""

from __future__ import annotations

import argparse
import ast
from collections.abc import Iterator
import json
from pathlib import Path
import re
import subprocess

TOP = Path(__file__).resolve().parents[1]
CORE = TOP / 'isotruss_ros' / 'core'
RELEASE = Path(__file__).with_name('release_figures.json')
PARTS = ('isotruss_ros', 'msg_defs', 'examples', 'studies', 'tools', 'docs/_ext', 'test')
#: Packages of the core whose closures are counted.
CLOSURES = (('manipulation',), ('holding', 'safety'), ('servo',), ('planning',))
NUMBER_CALLS = re.compile(r'(?:np\.(?:deg2rad|finfo|exp|array|linspace)|float|math\.\w+)$')
#: Number of lines of the body of a long function, and of arguments of one with many [-].
LONG_BODY, MANY_ARGUMENTS = 41, 8
#: Names that begin with an underscore and are public.
PUBLIC = re.compile(r'_(?:replace|asdict|fields|make|repr_html_|_\w+__)$')
#: Words that tests use for any quantity or act.
WORDS = ('found', 'made', 'said', 'given', 'each')

Figures = dict[str, float]


def read(path: Path) -> str:
    """Return the text of a file."""
    return path.read_text(encoding='utf-8')


def parse(folder: Path) -> dict[Path, ast.Module]:
    """Return the syntax trees of the Python files of a folder."""
    return {path: ast.parse(read(path)) for path in sorted(folder.rglob('*.py'))}


def lines_of(folder: Path) -> int:
    """Return the number of lines of the sources and interfaces of a folder."""
    kinds = {'.py', '.sh', '.msg', '.srv', '.action'}
    return sum(read(p).count('\n') for p in folder.rglob('*') if p.suffix in kinds)


def size_figures() -> Figures:
    """Return the lines of the parts of the repository and of the folders of tests."""
    figures: Figures = {f'{part}/': lines_of(TOP / part) for part in PARTS}
    for folder in sorted(path.parent for path in (TOP / 'test').rglob('test_*.py')):
        name = folder.relative_to(TOP).as_posix()
        figures[f'{name}/*.py'] = sum(read(path).count('\n') for path in folder.glob('*.py'))
    return {f'lines of {name}': lines for name, lines in figures.items()}


def imports(tree: ast.Module) -> Iterator[str]:
    """Yield the modules below isotruss_ros.core that a file may import."""
    prefix = 'isotruss_ros.core.'
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and f'{node.module}.'.startswith(prefix):
            inside = f'{node.module}.'.removeprefix(prefix)
            yield from (inside.rstrip('.'), *(inside + alias.name for alias in node.names))


def structure_figures() -> Figures:
    """Return closures, files and floors of the packages of the core, and its named numbers."""
    trees = parse(CORE)
    used = {path: {file_of(name) for name in imports(tree)} for path, tree in trees.items()}
    figures: Figures = {}
    for packages in CLOSURES:
        closure: set[Path] = set()
        waiting = [path for path in trees if path.relative_to(CORE).parts[0] in packages]
        while waiting:
            path = waiting.pop()
            if path in trees and path not in closure:
                closure.add(path)
                waiting += used[path]
        lines = [line.strip() for path in closure for line in read(path).splitlines()]
        name = ' and '.join(packages)
        figures[f'files of {name} with imports'] = len(closure)
        code = sum(bool(line) and not line.startswith('#') for line in lines)
        figures[f'lines of code of {name} with imports'] = code
    for package in sorted(path.parent for path in CORE.glob('*/__init__.py')):
        left = {path for path in package.glob('*.py') if path.stem != '__init__'}
        figures[f'files of core/{package.name}'] = len(left)
        floors = 0
        while left:
            above = {path for path in left if used[path] & left - {path}}
            floors, left = floors + 1, above if above != left else set()
        figures[f'floors of core/{package.name}'] = floors
    for part in ('isotruss_ros', 'test', 'examples'):
        longest = max(read(path).count('\n') for path in (TOP / part).rglob('*.py'))
        figures[f'lines of the longest file of {part}/'] = longest
    figures['lines of README.md'] = read(TOP / 'README.md').count('\n')
    figures['named numbers of the core'] = sum(
        len(list(numbers(tree.body))) for tree in trees.values()
    )
    functions = [
        node
        for tree in trees.values()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
    ]
    figures['long bodies of the core'] = sum(body_lines(f) >= LONG_BODY for f in functions)
    figures['functions of the core with many arguments'] = sum(
        sum(isinstance(n, ast.arg) and n.arg not in {'self', 'cls'} for n in ast.walk(f.args))
        >= MANY_ARGUMENTS
        for f in functions
    )
    return figures


def file_of(module: str) -> Path:
    """Return the path of a module below isotruss_ros.core, which need not exist."""
    return CORE.joinpath(*module.split('.')).with_suffix('.py')


def body_lines(function: ast.FunctionDef) -> int:
    """Return the number of lines of a body without its docstring."""
    body = function.body[ast.get_docstring(function) is not None :]
    return body[-1].end_lineno - body[0].lineno + 1 if body else 0


def is_number(value: ast.expr) -> bool:
    """Return whether an expression consists of numbers."""
    nodes = list(ast.walk(value))
    return any(isinstance(node, ast.Constant) for node in nodes) and not any(
        (isinstance(node, ast.Constant) and not isinstance(node.value, int | float | complex))
        or isinstance(node, (ast.Dict, ast.Set, ast.DictComp, ast.ListComp, ast.Subscript))
        or (isinstance(node, ast.Call) and not NUMBER_CALLS.match(ast.unparse(node.func)))
        for node in nodes
    )


def numbers(body: list[ast.stmt], is_enum: bool = False) -> Iterator[str]:
    """Yield the names of the numbers of modules and classes, except members of enumerations."""
    for node in body:
        if isinstance(node, ast.ClassDef):
            yield from numbers(node.body, any('Enum' in ast.unparse(base) for base in node.bases))
        elif isinstance(node, ast.Assign) and not is_enum:
            for target in node.targets:
                pairs = [(target, node.value)]
                if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                    pairs = list(zip(target.elts, node.value.elts, strict=True))
                for name, value in pairs:
                    if re.fullmatch('[A-Z][A-Z0-9_]+', ast.unparse(name)) and is_number(value):
                        yield ast.unparse(name)


def call_figures() -> Figures:
    """Return the calls, files and moves between files of a settle, a decide and others."""
    from studies.benchmarks import call_path

    figures: Figures = {}
    for name, walk in call_path.walks().items():
        figures |= {
            f'calls of {name}': walk.calls,
            f'files of {name}': len(walk.files),
            f'moves of {name}': walk.moves,
        }
    return figures


def test_figures() -> Figures:
    """Return patches, private attributes and words of the tests."""
    patches = own = private = 0
    files = parse(TOP / 'test')
    for tree in files.values():
        foreign = {
            (alias.asname or alias.name).split('.')[0]
            for node in ast.walk(tree)
            if isinstance(node, (ast.Import, ast.ImportFrom))
            for alias in node.names
            if not (getattr(node, 'module', '') or alias.name).startswith(('isotruss', 'studies'))
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and ast.unparse(node.func).endswith('patch.setattr'):
                patches += 1
                # A module of ours has foreign ones as attributes.
                root, *inner = ast.unparse(node.args[0]).split('.')
                own += root not in foreign and inner[-1:] not in (['time'], ['importlib'])
            elif isinstance(node, ast.Attribute) and node.attr.startswith('_'):
                of_self = isinstance(node.value, ast.Name) and node.value.id in {'self', 'cls'}
                private += not of_self and not PUBLIC.match(node.attr)
    text = '\n'.join(map(read, files))
    return {
        'calls of setattr of monkeypatch in tests': patches,
        '- of them on modules and objects of ours': own,
        'private attributes of objects in tests': private,
        **{f'word "{word}" in tests': len(re.findall(rf'\b{word}\b', text)) for word in WORDS},
    }


def main() -> None:
    """Print the figures beside those of the last release, or store them as those of a release."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--store', metavar='VERSION', help='store the figures of a release')
    version = parser.parse_args().store
    figures = size_figures() | structure_figures() | call_figures() | test_figures()
    if version:
        command = ['git', 'rev-parse', '--short=8', 'HEAD']
        done = subprocess.run(command, cwd=TOP, check=True, capture_output=True, text=True)
        stored = {'release': version, 'commit': done.stdout.strip(), 'figures': figures}
        text = json.dumps(stored, indent=2)
        RELEASE.write_text(text + '\n', encoding='utf-8')
    release = json.loads(read(RELEASE)) if RELEASE.exists() else {'release': '-', 'figures': {}}
    before = release['figures']
    print(f'{"":56}{"today":>8}{release["release"]:>8}')
    for name in [*figures, *(before.keys() - figures)]:
        print(f'{name:56}{figures.get(name, "-"):>8}{before.get(name, "-"):>8}')


if __name__ == '__main__':
    main()
