# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Mutation tests of the loop that holds an object: small faults in the sources fail some test.

A mutant is a source file with one operator or number changed by Cosmic Ray. The tests that execute
its function run in a forked process, the shortest first. A mutant that passes them survives; the
exit code is 1 if more than 8 % of the mutants survive. Two copies of the tree are tested at once.

    python tools/mutants.py --count 200 --seed 0
"""

from __future__ import annotations

import argparse
import ast
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
import functools
from hashlib import sha256
import itertools
import json
import multiprocessing
from operator import itemgetter
import os
from pathlib import Path
import queue
import shutil
import subprocess
import sys
import threading
import time
from typing import Any, NamedTuple

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import MutationVisitor
from cosmic_ray.operators.operator import Operator
from cosmic_ray.operators.provider import OperatorProvider
import coverage
import hypothesis  # noqa: F401 - loaded before forks, as the next three
import numpy as np  # noqa: F401
import pytest

TOP = Path(__file__).parents[1]
CORE = 'isotruss_ros/core/'
#: Mutated files, and the tests that are tried first.
FOLDERS = {
    'safety': ([CORE + 'safety/*.py'], ('test/core/safety',)),
    'servo': ([CORE + 'servo/*.py'], ('test/core/servo',)),
    'recording': ([CORE + 'recording/*.py'], ('test/core/recording',)),
    'estimation': ([CORE + 'estimation/*.py'], ('test/core/estimation',)),
    'holding': ([CORE + 'holding/*.py'], ('test/core/holding',)),
    'gate': (
        [
            CORE + 'inputs.py',
            'isotruss_ros/nodes/framework/gate.py',
            'isotruss_ros/nodes/framework/received_inputs.py',
        ],
        ('test/core/test_inputs.py', 'test/nodes/inputs', 'test/nodes/faults'),
    ),
}
#: Tests that count; random calls and planning take long, and the others do not hold objects.
TESTS = [
    *(f'test/core/{name}' for name in ('safety', 'servo', 'recording', 'estimation', 'holding')),
    *(f'test/core/{name}' for name in ('contact', 'manipulation', 'paths', 'simulation')),
    *(f'test/core/test_{name}.py' for name in ('inputs', 'symmetries')),
    *(f'test/nodes/{name}' for name in ('inputs', 'faults', 'motion', 'trajectories', 'grasp')),
]
#: Endings of the operators of Cosmic Ray whose faults every test finds, as bits of floating point
#: numbers, or none, as equality and identity of enumerations
#: and None, or products of masks.
NO_FAULTS = (
    '_Is_Eq',
    '_IsNot_NotEq',
    '_BitAnd_Mul',
    'RemoveDecorator',
    'VariableReplacer',
    'VariableInserter',
    *('_FloorDiv', '_Mod', '_RShift', '_LShift', '_BitXor', '_Invert', '_Is', '_IsNot'),
)
#: Options of pytest.
OPTIONS = ['-q', '-n', '0', '-p', 'no:cacheprovider']
#: List of equal mutants, with reasons.
EQUAL = Path(__file__).with_name('equal_mutants.json')
#: Largest share of surviving mutants [-].
MAX_SURVIVING_SHARE = 0.08
#: Number of copies of the tree, in each of which one process runs tests.
COPIES = 2
#: Largest duration of the tests of a mutant, as measured without mutants [s].
MAX_TEST_DURATION = 60.0


#: Held during a fork: a process forked while another thread imports would wait for its lock.
FORK = threading.Lock()


class Mutant(NamedTuple):
    """Source file with one change, which an operator of Cosmic Ray makes."""

    folder: str  #: name of the folder
    path: str  #: path of the file
    line: int  #: number of the changed line
    operator: Operator  #: operator that makes the change
    number: int  #: number of the change among those of the operator

    def change(self, source: str) -> str:
        """Return the changed source of the file."""
        return MutationVisitor.mutate_code(source, self.operator, self.number)

    def lines(self, tree: Path) -> tuple[str, str]:
        """Return the changed line before and after."""
        source = (tree / self.path).read_text(encoding='utf-8')
        lines = zip(source.splitlines(), self.change(source).splitlines(), strict=False)
        before, after = next((one, other) for one, other in lines if one != other)
        return before.strip(), after.strip()


def copy_tree(tree: Path) -> None:
    """Copy the files of the repository, which are mutated there."""
    shutil.rmtree(tree, ignore_errors=True)
    command = ['git', 'ls-files', '-z', '--cached', '--others', '--exclude-standard']
    listed = subprocess.run(command, cwd=TOP, check=True, capture_output=True, text=True).stdout
    for name in filter(None, listed.split('\0')):
        if (TOP / name).exists():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(TOP / name, tree / name, follow_symlinks=False)
    # Bytecode that is valid by the content of a source, because mutants have equal times.
    options = ['-q', '--invalidation-mode', 'checked-hash']
    subprocess.run(
        [sys.executable, '-m', 'compileall', *options, tree / 'isotruss_ros'], check=True
    )


def in_fork(tree: Path, work: Callable[[], Any], timeout: float | None = None) -> int | None:
    """Return the exit code of a function in a forked process; None after a timeout [s]."""

    def run() -> None:
        os.chdir(tree)
        sys.path.insert(0, str(tree))
        sys.dont_write_bytecode = True
        log = os.open('log.txt', os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(log, 1)
        os.dup2(log, 2)
        os._exit(int(work()))

    process = multiprocessing.get_context('fork').Process(target=run)
    with FORK:
        process.start()
    process.join(timeout)
    if process.exitcode is None:
        process.kill()
        process.join()
        return None
    return process.exitcode


class Recorder:
    """Plugin of pytest that records the durations of tests, and the lines that each executes."""

    def __init__(self, tree: Path) -> None:
        self.durations: dict[str, float] = {}
        source = [str(tree / 'isotruss_ros')]
        self._coverage = coverage.Coverage(str(tree / '.coverage'), source=source)
        self._coverage.start()

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        """Count the lines that are executed from now on to this test."""
        self._coverage.switch_context(nodeid)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Add the duration of a part of a test."""
        self.durations[report.nodeid] = self.durations.get(report.nodeid, 0.0) + report.duration

    def pytest_sessionfinish(self) -> None:
        """Write what was recorded."""
        self._coverage.stop()
        self._coverage.save()
        Path('durations.json').write_text(json.dumps(self.durations), encoding='utf-8')


def measure(trees: list[Path]) -> tuple[dict[str, float], list[coverage.CoverageData]]:
    """Run the tests without mutants; return their durations [s] and the lines they execute."""
    shares = [TESTS[number :: len(trees)] for number in range(len(trees))]
    with ThreadPoolExecutor(len(trees)) as pool:
        failed = list(pool.map(record_tests, trees, shares))
    if any(failed):
        sys.exit('the tests fail without mutants, see .mutants/*/log.txt')
    durations: dict[str, float] = {}
    recorded = [coverage.CoverageData(str(tree / '.coverage')) for tree in trees]
    for tree, data in zip(trees, recorded, strict=True):
        data.read()
        durations |= json.loads((tree / 'durations.json').read_text(encoding='utf-8'))
    return durations, recorded


def record_tests(tree: Path, tests: list[str]) -> int | None:
    """Run tests in a copy of the tree with a `Recorder`; return the exit code."""
    command = [*OPTIONS, '-m', 'not nightly', *tests]
    return in_fork(tree, lambda: pytest.main(command, plugins=[Recorder(tree)]))


def all_mutants(tree: Path, folder: str, seed: int) -> Iterator[tuple[bytes, Mutant]]:
    """Yield the mutants of a folder with their keys; see `draw_mutants`, `unchanged_spans`."""
    provider = OperatorProvider()
    kinds = [kind for kind in provider if not kind.endswith(NO_FAULTS)]
    for path in sorted(path for pattern in FOLDERS[folder][0] for path in tree.glob(pattern)):
        source, name = path.read_text(encoding='utf-8'), str(path.relative_to(tree))
        nodes, fixed = list(ast_nodes(get_ast(source))), list(unchanged_spans(source))
        lines = source.splitlines()
        for kind in kinds:
            operator = provider[kind]()
            spots = [spot for node in nodes for spot in operator.mutation_positions(node)]
            for number, (start, _) in enumerate(spots):
                if not any(begin <= start < end for begin, end in fixed):
                    place = (seed, name, lines[start[0] - 1], start[1], kind)
                    key = sha256(repr(place).encode()).digest()
                    yield key, Mutant(folder, name, start[0], operator, number)


def unchanged_spans(source: str) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
    """Yield begin and end (line, column) of annotations, decorators and the flags `strict`."""
    for node in ast.walk(ast.parse(source)):
        kept = [getattr(node, 'annotation', None), getattr(node, 'returns', None)]
        kept += [word.value for word in getattr(node, 'keywords', []) if word.arg == 'strict']
        for part in [*kept, *getattr(node, 'decorator_list', [])]:
            if part is not None:
                yield (part.lineno, part.col_offset), (part.end_lineno, part.end_col_offset)


def find_tests(
    trees: list[Path],
    mutant: Mutant,
    durations: dict[str, float],
    recorded: list[coverage.CoverageData],
) -> list[str]:
    """Return the tests of the function of a mutant, or of any function of its file or folder."""
    parsed = ast.parse((trees[0] / mutant.path).read_text(encoding='utf-8'))
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef)
    functions = [node for node in ast.walk(parsed) if isinstance(node, kinds)]
    around = [node for node in functions if node.lineno <= mutant.line <= node.end_lineno]
    lines = {
        line for node in around or functions for line in range(node.lineno, node.end_lineno + 1)
    }
    executing = set()
    for tree, data in zip(trees, recorded, strict=True):
        contexts = data.contexts_by_lineno(str(tree / mutant.path))
        executing |= {test for line in lines for test in contexts.get(line, ()) if test}
    own = FOLDERS[mutant.folder][1]
    if not functions:  # a file of constants
        executing = {test for test in durations if test.startswith(own)}
    ordered = sorted(executing, key=lambda test: (not test.startswith(own), durations[test]))
    spent = itertools.accumulate(durations[test] for test in ordered)
    return [test for test, s in zip(ordered, spent, strict=True) if s < MAX_TEST_DURATION]


def draw_mutants(tree: Path, folder: str, count: int, seed: int) -> list[Mutant]:
    """
    Return a random sample of the mutants of a folder, without those listed as equal.

    A mutant is drawn by its line, so that a sample stays the same while its lines do.
    """
    equal = {(entry['path'], entry['before'], entry['after']) for entry in read_equal()}
    mutants = (mutant for _, mutant in sorted(all_mutants(tree, folder, seed), key=itemgetter(0)))
    unlisted = (mutant for mutant in mutants if (mutant.path, *mutant.lines(tree)) not in equal)
    return list(itertools.islice(unlisted, count))


def survives(mutant: Mutant, trees: queue.Queue[Path], tests: list[str], limit: float) -> bool:
    """Return whether a mutant passes tests within a time limit [s]; print it if it does."""
    tree = trees.get()
    path = tree / mutant.path
    original, (before, after) = path.read_text(encoding='utf-8'), mutant.lines(tree)
    run = functools.partial(pytest.main, [*OPTIONS, '-x', *tests])
    try:
        path.write_text(mutant.change(original), encoding='utf-8')
        passes = not tests or in_fork(tree, run, limit) == 0
    finally:
        path.write_text(original, encoding='utf-8')
        trees.put(tree)
    if passes:
        message = f'{mutant.path}:{mutant.line}: passes {len(tests)} tests'
        print(f'{message}\n- {before}\n+ {after}', flush=True)
    return passes


@functools.cache
def read_equal() -> list[dict[str, str]]:
    """Return the mutants that no input distinguishes from the sources; print outdated ones."""
    listed = json.loads(EQUAL.read_text(encoding='utf-8'))
    for entry in listed:
        lines = (TOP / entry['path']).read_text(encoding='utf-8').splitlines()
        if entry['before'] not in map(str.strip, lines):
            print(
                f'{EQUAL.name}: {entry["path"]} has no line "{entry["before"]}": delete the entry'
            )
    return listed


def main() -> int:
    """Try a random sample of the mutants; print the survivors and the shares."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--count', type=int, default=200, help='number of mutants')
    parser.add_argument('--seed', type=int, default=0, help='seed of the random choice')
    parser.add_argument('--folders', nargs='*', default=list(FOLDERS), choices=FOLDERS)
    options = parser.parse_args()
    trees = [TOP / '.mutants' / str(number) for number in range(COPIES)]
    for tree in trees:
        copy_tree(tree)
    durations, recorded = measure(trees)
    free: queue.Queue[Path] = queue.Queue()
    for tree in trees:
        free.put(tree)
    survived = tried = 0
    for folder in options.folders:
        count = -(-options.count // len(options.folders))
        mutants = draw_mutants(trees[0], folder, count, options.seed)
        tests = [find_tests(trees, mutant, durations, recorded) for mutant in mutants]
        limits = [20.0 + 5.0 * sum(durations[test] for test in own) for own in tests]
        begin = time.monotonic()
        with ThreadPoolExecutor(COPIES) as pool:
            passed = list(pool.map(survives, mutants, itertools.repeat(free), tests, limits))
        survived, tried = survived + sum(passed), tried + len(mutants)
        duration = time.monotonic() - begin
        print(f'{folder}: {sum(passed)} of {len(mutants)} survive; {duration:.0f} s', flush=True)
    print(f'{survived} of {tried} mutants survive; at most {MAX_SURVIVING_SHARE:.0%} may')
    return int(survived > MAX_SURVIVING_SHARE * tried)


if __name__ == '__main__':
    sys.exit(main())
