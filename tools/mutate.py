# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Change one operator or number of the core at a time, and print the changes that no test notices.

usage: mutate.py [--sample N] [--seed S] FILES_OR_FOLDERS

Each mutant runs tests of its own package, `test/core/<package>`. Tests are collected once, and
each mutant is a fork in which functions get the changed code; it runs the tests that run the
changed line, the quickest first, on few random examples, and on more of them if it survives. Which
tests those are is recorded once, for the files of a package as they are. What is computed while
modules are imported imports the changed file in a process of its own. The share of mutants that
are noticed is a lower bound: tests that take more than four seconds are left out, and those that
read what another one has cached, which survivors run with --thorough. A mutant that takes ten
times as long as its tests counts as noticed, and is listed. Nothing is written but records in the
environment's folder. Not changed: indices, annotations, and what stands in error messages.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
import importlib
import json
import multiprocessing
import os
from pathlib import Path
import random
import sys
from typing import Any

import coverage
from mutation.changed import MutantFinder
from mutation.loop import (
    ALIVE,
    GRACE,
    KILLED,
    LATE,
    NoShrinking,
    PATIENCE,
    RecordTests,
    run_apart,
    RunMutants,
    RunUntilFailure,
    UNFIT,
)
from mutation.neutral import is_neutral, read_neutral
from mutation.record import read, read_noticed, Record, write, write_noticed
from mutation.sites import find_mutants, Mutant

ROOT = Path(__file__).resolve().parents[1]
CORE = ROOT / 'isotruss_ros' / 'core'
#: Shares of the random examples: at first, and of what survives that.
FEW, USUAL = '0.05', '0.2'
#: A mutant that `neutral.yaml` lists.
NEUTRAL = 'neutral'
RECORDS = Path(sys.prefix) / 'mutation'


def run_tests(package: Path, plugin: object, share: str) -> int:
    """Run the tests of a package by a plugin; 0 if none fails."""
    os.environ['EXAMPLES_SHARE'] = share
    # New interpreters would import the code without the change.
    fork = multiprocessing.get_context('fork')
    multiprocessing.get_context = lambda *_: fork
    import pytest

    quiet = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(quiet, stream)
    folder = str(ROOT / 'test' / 'core' / package.name)
    options = ['-q', '--tb=no', '-o', 'timeout=600', '-o', 'cache_dir=/dev/null']
    off = [word for name in ('cacheprovider', 'xdist') for word in ('-p', f'no:{name}')]
    return int(pytest.main([folder, *options, *off], plugins=[plugin, NoShrinking()]))


def record_tests(package: Path) -> Record:
    """Return which tests run which lines of a package; read from a file if it is known."""
    path = RECORDS / f'{package.name}.json'
    known = read(path, package)
    if known:
        return known

    def run() -> str:
        tracer = coverage.Coverage(None, branch=True, config_file=False, include=[f'{package}/*'])
        tracer.start()
        plugin = RecordTests(package, tracer)
        failed = run_tests(package, plugin, FEW)
        write(plugin.record, path, package)
        with path.with_suffix('.coverage').open('w', encoding='utf-8') as lines:
            tracer.report(show_missing=True, skip_covered=True, file=lines)
        return 'fail' if failed else 'pass'

    outcome = run_apart(run, 3600)
    assert outcome == 'pass', f'{package.name}: its tests fail without any change'
    return read(path, package)


def run_mutants(
    package: Path, mutants: list[Mutant], record: Record, options: argparse.Namespace
) -> Iterator[tuple]:
    """Yield each mutant of a package and whether the tests notice it."""
    unread = [m for m in mutants if m.in_function and not record.contexts(m)]
    yield from ((mutant, ALIVE) for mutant in unread)
    again = [mutant for mutant in mutants if not mutant.in_function]
    inside = [mutant for mutant in mutants if mutant.in_function and mutant not in unread]
    for share in (FEW,) if options.few else (FEW, USUAL):
        alive, told = [], 0
        for mutant, result in _stream(
            lambda tell, own=inside, part=share: run_tests(
                package, RunMutants(own, record, tell), part
            )
        ):
            told += 1
            if result == UNFIT:
                again.append(mutant)
            elif result == ALIVE:
                alive.append(mutant)
            else:
                yield mutant, result
        assert told == len(inside), f'{package.name}: its tests fail without any change'
        inside = alive
    for mutant in inside:
        # What was computed before the change was made did not notice it.
        if options.thorough or '' in record.contexts(mutant):
            again.append(mutant)
        else:
            yield mutant, ALIVE
    limit = GRACE + PATIENCE * sum(record.quick.values())
    for mutant in again:
        plugin = RunUntilFailure(mutant, record, options.thorough)
        yield mutant, run_apart(lambda p=plugin, m=mutant: _import_changed(package, m, p), limit)


def _import_changed(package: Path, mutant: Mutant, plugin: RunUntilFailure) -> str:
    sys.meta_path.insert(0, MutantFinder(mutant, ROOT))
    run_tests(package, plugin, USUAL)
    return plugin.result


def _stream(serve: Callable[[Callable], Any]) -> Iterator[tuple]:
    """Yield what a process tells that is forked for it."""
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        try:
            serve(lambda mutant, result: os.write(writer, _line(mutant, result)))
        finally:
            os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as lines:
        for line in lines:
            (path, *rest), result = json.loads(line)
            yield Mutant(Path(path), *rest), result
    os.waitpid(child, 0)


def _line(mutant: Mutant, result: str) -> bytes:
    return (json.dumps([[str(mutant.path), *mutant[1:]], result]) + '\n').encode()


def interval(killed: int, total: int, z: float = 1.96) -> tuple[float, float]:
    """Return the 95 % interval of a share of which a sample is known (Wilson)."""
    share, n = killed / total, total
    middle = (share + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * (share * (1 - share) / n + z**2 / (4 * n**2)) ** 0.5
    return middle - half, middle + half


def run_package(package: Path, mutants: list[Mutant], options: argparse.Namespace) -> list[str]:
    """Return the results of the mutants of a package, or of a sample; print what survives."""
    if options.sample is not None:
        drawn = random.Random(f'{options.seed} {package.name}')
        mutants = drawn.sample(mutants, min(options.sample, len(mutants)))
    neutral = read_neutral()
    record, path = record_tests(package), RECORDS / f'{package.name}.noticed'
    noticed = read_noticed(path, package) if options.resume else set()
    known = [mutant for mutant in mutants if mutant.name in noticed]
    results = [KILLED] * len(known)
    left = [mutant for mutant in mutants if mutant.name not in noticed]
    for mutant, result in run_mutants(package, left, record, options):
        results.append(result)
        if result == KILLED:
            noticed.add(mutant.name)
            write_noticed(noticed, path, package)
        elif result == ALIVE and is_neutral(mutant, neutral):
            results[-1] = NEUTRAL
        else:
            place = f'{mutant.path.relative_to(CORE)}:{mutant.first}'
            print(f'{place}: {mutant.words} ({result}): {mutant.source}', flush=True)
    return results


def print_row(name: str, results: list[str], total: int) -> None:
    """Print the row of a package."""
    n, neutral = len(results), results.count(NEUTRAL)
    noticed = sum(result in (KILLED, LATE) for result in results)
    low, high = interval(noticed, n)
    between = f', {100 * low:.0f} to {100 * high:.0f} %' if n < total else ''
    share = f'{100 * noticed / n:.1f} %{between}'
    print(
        f'| {name} | {total} | {n} | {noticed} | {share} | {neutral} | {n - noticed - neutral} |'
    )


def main() -> None:
    """Run the mutants of the files, or a sample of those of each package."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('files', nargs='*', type=Path, default=[CORE])
    parser.add_argument('--sample', type=int, help='that many of each package, drawn at random')
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--thorough', action='store_true', help='survivors run all tests')
    parser.add_argument('--few', action='store_true', help='survivors run no more examples')
    parser.add_argument('--resume', action='store_true', help='what was noticed stays so')
    options = parser.parse_args()
    paths = [path.resolve() for path in options.files]
    files = sorted(
        {file for path in paths for file in (path.rglob('*.py') if path.is_dir() else [path])}
    )
    os.chdir(ROOT)
    sys.path.insert(0, str(ROOT))
    sys.dont_write_bytecode = False
    os.environ['OPENBLAS_NUM_THREADS'] = '1'
    # What the core imports is imported once; the core itself by each process that imports it.
    for name in ('coverage', 'hypothesis', 'pytest', 'isotruss_ros.core'):
        importlib.import_module(name)
    for name in [name for name in sys.modules if name.split('.')[0] == 'isotruss_ros']:
        del sys.modules[name]
    rows = []
    for package in sorted({file.parent for file in files} - {CORE}):
        own = [mutant for file in files if file.parent == package for mutant in find_mutants(file)]
        rows.append((package.name, run_package(package, own, options), len(own)))
    print('| package | mutants | run | noticed | share | change nothing | left |')
    print('| --- ' * 7 + '|')
    for row in rows:
        print_row(*row)


if __name__ == '__main__':
    main()
