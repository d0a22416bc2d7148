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
