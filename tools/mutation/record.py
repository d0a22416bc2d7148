# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Which tests of a package run which lines, and for how long."""

from __future__ import annotations

import hashlib
import json
import math
from pathlib import Path
from typing import NamedTuple

from mutation.names import find_uses
from mutation.sites import Mutant


class Record(NamedTuple):
    """Processor time of each test [s], infinite if it is left out; which run each line."""

    seconds: dict[str, float]
    lines: dict[str, dict[int, list[str]]]

    def choose(self, mutant: Mutant) -> dict[str, float]:
        """Return the tests that run the changed lines, or what uses them, with their times."""
        named, quick = self.contexts(mutant), self.quick
        return {test: quick[test] for test in named if test in quick}

    @property
    def quick(self) -> dict[str, float]:
        """Return the times of the tests that are run at all."""
        return {test: seconds for test, seconds in self.seconds.items() if seconds < math.inf}

    def contexts(self, mutant: Mutant) -> set[str]:
        """Return the same tests, and '' if that also runs before any test."""
        path = mutant.path
        lines = {(path.name, line) for line in range(mutant.first, mutant.last + 1)}
        if not mutant.in_function:
            lines = find_uses(path.parent, path, mutant.first)
        files = self.lines
        return {test for name, line in lines for test in files.get(name, {}).get(line, [])}


def write(record: Record, path: Path, package: Path) -> None:
    """Write a record of a package."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps([_digest(package), *record]), encoding='utf-8')


def read(path: Path, package: Path) -> Record | None:
    """Read the record of a package; None if there is none of the files as they are."""
    if not path.exists():
        return None
    digest, seconds, lines = json.loads(path.read_text(encoding='utf-8'))
    if digest != _digest(package):
        return None
    numbered = {
        name: {int(line): tests for line, tests in found.items()} for name, found in lines.items()
    }
    return Record(seconds, numbered)


def read_noticed(path: Path, package: Path) -> set[str]:
    """Read which mutants of a package, of the files as they are, were noticed before."""
    first, *names = path.read_text(encoding='utf-8').splitlines() if path.exists() else ['']
    return set(names) if first == _digest(package) else set()


def write_noticed(names: set[str], path: Path, package: Path) -> None:
    """Write which mutants of a package were noticed."""
    path.write_text('\n'.join([_digest(package), *sorted(names)]), encoding='utf-8')


def _digest(package: Path) -> str:
    files = sorted(package.glob('*.py'))
    return hashlib.sha256(b'\0'.join(path.read_bytes() for path in files)).hexdigest()
