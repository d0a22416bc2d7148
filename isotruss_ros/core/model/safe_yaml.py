# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parser of YAML from outside, with bounds on size and nesting depth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.numerics.arrays import MAX_ENTRIES
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError
from ruamel.yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent, ScalarEvent
from ruamel.yaml.parser import Parser

#: Largest size of a file [characters]; a robot of 300 modules needs 30 kB.
MAX_FILE_SIZE = 200_000
#: Largest nesting depth [-]. Robot files need four; the time of parsing is quadratic in the depth.
MAX_NESTING_DEPTH = 8


def read_text(path: Path, kind: str, error: type[IsotrussError]) -> str:
    """Return the text of a file."""
    try:
        with path.open('rb') as file:
            data = file.read(MAX_FILE_SIZE + 1)
    except (OSError, ValueError) as problem:
        reason = getattr(problem, 'strerror', None) or problem
        raise error(f'{path}: cannot be read: {reason}') from problem
    if len(data) > MAX_FILE_SIZE:
        raise error(f'{path}: too long; {kind} has at most {MAX_FILE_SIZE} bytes')
    try:
        return data.decode('utf-8')
    except UnicodeDecodeError as problem:
        raise error(f'{path}: byte {problem.start}: not UTF-8 text') from problem


def parse_yaml(source: object, text: str, kind: str, refusal: type[IsotrussError]) -> Any:
    """Return the content of a YAML 1.2 text: plain values, lists and mappings."""

    class BoundedParser(Parser):
        """Parser that refuses an event before the value of it is constructed."""

        depth = 0

        def get_event(self) -> Any:
            event = super().get_event()
            self.depth += isinstance(event, CollectionStartEvent)
            self.depth -= isinstance(event, CollectionEndEvent)
            if fault := _find_fault(event, self.depth, kind):
                raise refusal(f'{source}: line {event.start_mark.line + 1}: {fault}')
            return event

    yaml = YAML(typ='safe', pure=True)
    yaml.Parser = BoundedParser
    try:
        return yaml.load(text)
    except YAMLError as error:
        mark = getattr(error, 'problem_mark', None)
        where = f'line {mark.line + 1}, column {mark.column + 1}: ' if mark else ''
        problem = getattr(error, 'problem', None) or str(error).splitlines()[0]
        raise refusal(f'{source}: {where}not YAML 1.2: {problem}') from error
    except refusal:
        raise
    # Constructors of ruamel.yaml raise these for invalid dates, long integers and wrong tags.
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise refusal(f'{source}: not YAML 1.2: {error}') from error


def _find_fault(event: Any, depth: int, kind: str) -> str:
    """Return the fault of a parser's event at a nesting depth; empty if there is none."""
    if depth > MAX_NESTING_DEPTH:
        return f'nested too deeply; {kind} have at most {MAX_NESTING_DEPTH} levels'
    if isinstance(event, ScalarEvent) and len(event.value) > MAX_ENTRIES:
        size = f'has {len(event.value)} characters; must be at most {MAX_ENTRIES}'
        return f'{event.value[:20]!r}... {size}'
    # An alias can refer to its own parent, or expand a small file to gigabytes.
    if getattr(event, 'anchor', None) is not None:
        name = f'{"*" if isinstance(event, AliasEvent) else "&"}{event.anchor}'
        return f'{name}: anchors and aliases are not used in {kind}; write the value out'
    return ''
