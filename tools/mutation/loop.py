# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What replaces the loop of pytest over its tests."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import math
import os
from pathlib import Path
import resource
import signal
import time

import coverage
from hypothesis import Phase, settings
from mutation.changed import swap_code
from mutation.record import Record
from mutation.sites import Mutant
import pytest

KILLED, ALIVE, LATE, UNFIT = 'killed', 'alive', 'late', 'unfit'
#: How many times as long as its tests a mutant may take, and what is added [s].
PATIENCE, GRACE = 10.0, 10.0
#: Tests that take more processor time than this are left out [s].
LONGEST = 4.0


def _leave_out(*signal_and_frame: object) -> None:
    pytest.skip(f'takes more than {LONGEST} s')


class NoShrinking:
    """Takes the first example that fails."""

    def pytest_configure(self) -> None:
        """Replace the profile of conftest.py, before any test is read."""
        settings.register_profile('mutate', deadline=None, phases=[Phase.explicit, Phase.generate])
        settings.load_profile('mutate')


class RecordTests:
    """Runs each test, and records how long it took and which lines it ran."""

    def __init__(self, package: Path, tracer: coverage.Coverage) -> None:
        self.record = Record({}, {})
        self._package, self._tracer = package, tracer

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Run one test."""
        self._tracer.switch_context(item.nodeid)
        start = time.process_time()
        signal.signal(signal.SIGPROF, _leave_out)
        signal.setitimer(signal.ITIMER_PROF, LONGEST)
        yield
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        taken = time.process_time() - start
        self.record.seconds[item.nodeid] = taken if taken < LONGEST else math.inf
        self._tracer.switch_context('')

    def pytest_sessionfinish(self) -> None:
        """Read which lines were run."""
        self._tracer.stop()
        data = self._tracer.get_data()
        for path in self._package.glob('*.py'):
            self.record.lines[path.name] = data.contexts_by_lineno(str(path))


class RunMutants:
    """Collects tests once; runs those that run the changed line, for each mutant in a fork."""

    def __init__(
        self, mutants: list[Mutant], record: Record, tell: Callable[[Mutant, str], None]
    ) -> None:
        self._mutants, self._record, self._tell = mutants, record, tell

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Run all mutants; none where new tests fail without any change."""
        new = newer(session, self._record)
        items = sort_items(session, new)
        if items and run_apart(lambda: run_until_failure(session, items), 600.0) != ALIVE:
            return True
        for mutant in self._mutants:
            tests = self._record.choose(mutant) | new
            items = sort_items(session, tests)
            if not items:
                self._tell(mutant, UNFIT)
                continue
            limit = GRACE + PATIENCE * sum(tests.get(item.nodeid, 1.0) for item in items)
            self._tell(mutant, run_apart(lambda m=mutant, i=items: _run(session, m, i), limit))
        return True


def _run(session: pytest.Session, mutant: Mutant, items: list[pytest.Item]) -> str:
    if not swap_code(mutant):
        return UNFIT
    return run_until_failure(session, items)


class RunUntilFailure:
    """Runs tests, those that run the changed line first, until one fails."""

    def __init__(self, mutant: Mutant, record: Record, thorough: bool) -> None:
        self._mutant, self._record, self._thorough = mutant, record, thorough
        self.result = KILLED

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Run the tests; all of them if none is known that runs the line."""
        first = self._record.choose(self._mutant)
        chosen = self._record.quick | newer(session, self._record)
        if first and not self._thorough:
            chosen = first | newer(session, self._record)
        items = sort_items(session, chosen)
        items.sort(key=lambda item: item.nodeid not in first)
        self.result = run_until_failure(session, items)
        return True


def newer(session: pytest.Session, record: Record) -> dict[str, float]:
    """Return the tests that are newer than the record."""
    return {item.nodeid: 0.0 for item in session.items if item.nodeid not in record.seconds}


def sort_items(session: pytest.Session, tests: dict[str, float]) -> list[pytest.Item]:
    """Return the tests that are named, the quickest first."""
    items = [item for item in session.items if item.nodeid in tests]
    return sorted(items, key=lambda item: tests[item.nodeid])


def run_until_failure(session: pytest.Session, items: list[pytest.Item]) -> str:
    """Run tests one after the other, until one fails."""
    for item, following in zip(items, [*items[1:], None], strict=True):
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        if session.testsfailed:
            return KILLED
    return ALIVE


def run_apart(run: Callable[[], str], limit: float) -> str:
    """Run in a process of its own, for some processor time [s]; what raises is killed."""
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        try:
            os.setsid()
            resource.setrlimit(resource.RLIMIT_CPU, (int(limit) + 1, int(limit) + 2))
            os.write(writer, run().encode())
        finally:
            os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as stream:
        result = stream.read()
    _, status = os.waitpid(child, 0)
    late = os.WIFSIGNALED(status) and os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL)
    return LATE if late else result or KILLED
