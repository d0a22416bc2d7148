"""
Change one operator or number of the core at a time, and print the changes that no test notices.

usage: mutate.py [--sample N] [--seed S] [--jobs J] [--own] FILES

Each mutant runs the tests of its own package, `test/core/<package>`, those of the file of the same
name first, in a forked process that compiles the changed file in place of the file; nothing is
written. Not changed: indices, annotations, and what stands in error messages.
"""

from __future__ import annotations

import argparse
import ast
from collections import Counter
from collections.abc import Callable, Iterator
import importlib
import importlib.abc
from importlib.machinery import SourceFileLoader
import importlib.util
import os
from pathlib import Path
import random
import signal
import sys
import time
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
SWAPPED = [(ast.Add, ast.Sub), (ast.Mult, ast.Div)]
#: Comparisons are reversed: of real numbers, < and <= differ only where nothing ever is.
SWAPPED += [(ast.Lt, ast.GtE), (ast.Gt, ast.LtE), (ast.Eq, ast.NotEq)]
CHANGES = dict(SWAPPED) | {new: old for old, new in SWAPPED}
CHANGES |= {ast.Pow: ast.Mult, ast.Mod: ast.Mult, ast.FloorDiv: ast.Mult, ast.USub: ast.UAdd}
SKIPPED_FIELDS = {'annotation', 'returns', 'slice', 'decorator_list'}
SKIPPED = (ast.Raise, ast.JoinedStr, ast.Assert, ast.Import, ast.ImportFrom)


class Site(NamedTuple):
    """A place that can be changed: its line, what changes, and the change."""

    line: int
    words: str
    change: Callable[[], None]


class Mutant(NamedTuple):
    """A file whose site `index` is changed; none if None."""

    path: Path
    index: int | None


def find_sites(node: ast.AST, arithmetic: bool = False) -> Iterator[Site]:
    """Yield what can be changed; whole numbers where they are operands of arithmetic."""
    operand = getattr(node, 'op', None)
    if isinstance(node, ast.BinOp | ast.AugAssign | ast.UnaryOp) and type(operand) in CHANGES:
        new = CHANGES[type(operand)]()
        words = f'{type(operand).__name__} -> {type(new).__name__}'
        yield Site(node.lineno, words, lambda: setattr(node, 'op', new))
    if isinstance(node, ast.Compare):
        for at, old in enumerate(node.ops):
            if type(old) in CHANGES:
                yield _reverse(node, at, CHANGES[type(old)]())
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        value = node.value + 1
        if isinstance(node.value, float):
            # Up or down, by the place in the line.
            value = node.value * (1.1 if node.col_offset % 2 else 0.9) or 0.1
        if isinstance(node.value, float) or arithmetic:
            words = f'{node.value!r} -> {value!r}'
            yield Site(node.lineno, words, lambda: setattr(node, 'value', value))
    for name, field in ast.iter_fields(node):
        if name in SKIPPED_FIELDS:
            continue
        for child in field if isinstance(field, list) else [field]:
            if isinstance(child, ast.AST) and not isinstance(child, SKIPPED):
                yield from find_sites(child, isinstance(node, ast.BinOp | ast.AugAssign))


def _reverse(node: ast.Compare, at: int, new: ast.cmpop) -> Site:
    words = f'{type(node.ops[at]).__name__} -> {type(new).__name__}'
    return Site(node.lineno, words, lambda: node.ops.__setitem__(at, new))


class MutantFinder(importlib.abc.MetaPathFinder):
    """Imports a changed module in place of the module."""

    def __init__(self, mutant: Mutant) -> None:
        tree = ast.parse(mutant.path.read_text(encoding='utf-8'))
        if mutant.index is not None:
            list(find_sites(tree))[mutant.index].change()
        path = str(mutant.path)
        code = compile(tree, path, 'exec')

        class Loader(SourceFileLoader):
            def get_code(self, fullname: str) -> object:
                return code

        self._name = '.'.join(mutant.path.relative_to(ROOT).with_suffix('').parts)
        self._spec = importlib.util.spec_from_file_location(
            self._name, path, loader=Loader(self._name, path)
        )

    def find_spec(self, fullname: str, path: object, target: object = None) -> object:
        """Return the spec of the changed module."""
        return self._spec if fullname == self._name else None


def run_tests(mutant: Mutant, only_own: bool) -> int:
    """Return 0 if the tests of the package pass with a mutant."""
    from hypothesis import Phase, settings
    import pytest

    settings.register_profile('mutate', phases=[Phase.explicit, Phase.generate])
    settings.load_profile('mutate')
    sys.meta_path.insert(0, MutantFinder(mutant))
    package = ROOT / 'test' / 'core' / mutant.path.parent.name
    own = package / f'test_{mutant.path.stem}.py'
    files = [own] if own.exists() else []
    if not (only_own and files):
        files += [path for path in sorted(package.glob('test_*.py')) if path != own]
    options = ['-x', '-q', '-p', 'no:cacheprovider', '-p', 'no:xdist', '--tb=no']
    return int(pytest.main([*map(str, files), *options]))


def fork(mutant: Mutant, only_own: bool) -> int:
    """Start the tests of a mutant in a process of its own; return its id."""
    child = os.fork()
    if child:
        return child
    os.setsid()
    quiet = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(quiet, stream)
    code = 1
    try:
        code = run_tests(mutant, only_own)
    finally:
        os._exit(min(code, 100))


def run_all(
    mutants: list[Mutant], jobs: int, timeout: float, only_own: bool
) -> Iterator[tuple[Mutant, int]]:
    """Yield mutants with the status of their tests as they end; SIGKILL if they take too long."""
    waiting, running = mutants[::-1], {}
    try:
        while waiting or running:
            while waiting and len(running) < jobs:
                mutant = waiting.pop()
                running[fork(mutant, only_own)] = mutant, time.monotonic() + timeout
            child, status = os.waitpid(-1, os.WNOHANG)
            if child:
                yield running.pop(child)[0], status
                continue
            for child, (_, deadline) in running.items():
                if time.monotonic() > deadline:
                    os.killpg(child, signal.SIGKILL)
            time.sleep(0.02)
    finally:
        for child in running:
            os.killpg(child, signal.SIGKILL)


def main() -> None:
    """Run the mutants of the files, or a sample of them."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('files', nargs='+', type=Path)
    parser.add_argument('--sample', type=int, help='that many, drawn at random')
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--jobs', type=int, default=os.cpu_count())
    parser.add_argument('--timeout', type=float, default=600.0, help='for one mutant [s]')
    parser.add_argument('--own', action='store_true', help='only the tests of the same name')
    options = parser.parse_args()
    files = [path.resolve() for path in options.files]
    os.chdir(ROOT)
    sys.path.insert(0, str(ROOT))
    sys.dont_write_bytecode = False
    os.environ['OPENBLAS_NUM_THREADS'] = '1'
    sites = {path: list(find_sites(ast.parse(path.read_text(encoding='utf-8')))) for path in files}
    waiting = [Mutant(path, i) for path, found in sites.items() for i in range(len(found))]
    if options.sample is not None:
        waiting = random.Random(options.seed).sample(waiting, min(options.sample, len(waiting)))
    unchanged = [Mutant(path, None) for path in {path.parent: path for path in files}.values()]
    # What the package imports is imported once; the package itself by each process.
    for name in ('hypothesis', 'pytest', 'isotruss_ros.core'):
        importlib.import_module(name)
    for name in [name for name in sys.modules if name.split('.')[0] == 'isotruss_ros']:
        del sys.modules[name]
    total, killed = Counter(), Counter()
    limits = options.jobs, options.timeout, options.own
    for (path, index), status in run_all(unchanged + waiting, *limits):
        if index is None:
            reason = 'take too long' if status == signal.SIGKILL else 'fail'
            assert status == 0, f'{path.parent.name}: its tests {reason} without any change'
            continue
        total[path.parent.name] += 1
        killed[path.parent.name] += status not in (0, signal.SIGKILL)
        site, late = sites[path][index], ' (timed out)' if status == signal.SIGKILL else ''
        if late or not status:
            print(f'{path.relative_to(ROOT)}:{site.line}: {site.words}{late}', flush=True)
    for package in sorted(total):
        print(f'{package}: {killed[package]} of {total[package]} mutants killed')


if __name__ == '__main__':
    main()
