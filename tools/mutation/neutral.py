# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Mutants that change nothing, or nothing that is promised: those of `neutral.yaml`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mutation.sites import Mutant
from ruamel.yaml import YAML


def read_neutral() -> dict[str, list[dict[str, Any]]]:
    """Return the entries of `neutral.yaml` by file."""
    path = Path(__file__).with_suffix('.yaml')
    return YAML(typ='safe', pure=True).load(path.read_text(encoding='utf-8'))


def is_neutral(mutant: Mutant, entries: dict[str, list[dict[str, Any]]]) -> bool:
    """Return whether an entry has the changed line and the change."""
    file = f'{mutant.path.parent.name}/{mutant.path.name}'
    return any(
        entry['line'] in mutant.source and mutant.words in entry.get('changes', [mutant.words])
        for entry in entries.get(file, [])
    )
