# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Fuzz the reader of robot files: it must return a robot, or raise RobotFileError.

Run by `make fuzz`; a finding is run again by giving its file:

    .venv/bin/python tools/fuzz/robot_file.py .fuzz/robot_file/crash-...
"""

from __future__ import annotations

import contextlib
import json
from pathlib import Path
import random
from typing import Any

import atheris

with atheris.instrument_imports(include=['isotruss_ros.core', 'ruamel.yaml', 'jsonschema']):
    from isotruss_ros.core.errors import RobotFileError
    from isotruss_ros.core.kinematics.robot import load_robot
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

from harness import fuzz_file

#: Values that replace a value of the file, as typing errors or broken generators would.
STRANGE: tuple[Any, ...] = (
    None,
    True,
    '',
    'x',
    'P',
    [],
    {},
    0,
    -1,
    0.0,
    5e-324,
    1e-12,
    1e12,
    1e308,
    10**30,
    float('inf'),
    float('nan'),
)


def read(path: Path) -> None:
    """Load a robot; a RobotFileError is no finding."""
    with contextlib.suppress(RobotFileError):
        load_robot(path)


def mutate(data: bytes, max_size: int, seed: int) -> bytes:
    """Return the document with a changed value, or in half of the cases with changed bytes."""
    rng = random.Random(seed)
    # Aliases unfold into gigabytes here, where nobody refuses them, and repeated anchors warn.
    if rng.random() < 0.5 and b'*' not in data and b'&' not in data:
        with contextlib.suppress(YAMLError, ValueError, LookupError, TypeError, AttributeError):
            document = YAML(typ='safe', pure=True).load(data.decode())
            changed = json.dumps(_changed(document, rng), default=str).encode()
            if len(changed) <= max_size:
                return changed
    return atheris.Mutate(data, len(data) if len(data) >= max_size else max_size)


def _places(value: Any) -> list[tuple[Any, Any]]:
    """Return the places of all values in a document: the containing block, and the key."""
    keys = list(value) if isinstance(value, dict) else range(len(value))
    found = []
    for key in keys:
        found.append((value, key))
        if isinstance(value[key], (dict, list)):
            found += _places(value[key])
    return found


def _changed(document: Any, rng: random.Random) -> Any:
    for _ in range(rng.randint(1, 3)):
        places = _places(document) if isinstance(document, (dict, list)) else []
        if not places:
            break
        block, key = rng.choice(places)
        value = block[key]
        other, other_key = rng.choice(places)
        change = rng.randrange(5)
        if change == 0:
            block[key] = rng.choice(STRANGE)
        elif change == 1 and isinstance(value, (int, float)):
            block[key] = value * rng.choice([-1.0, 0.5, 2.0, 1e-3, 1e3, 1e-9, 1e9])
        elif change == 2:
            block[key] = json.loads(json.dumps(other[other_key], default=str))
        elif change == 3:
            del block[key]
        elif isinstance(value, (dict, list)) and isinstance(block, dict):
            block[f'{key}{rng.randrange(10)}'] = json.loads(json.dumps(value, default=str))
    return document


if __name__ == '__main__':
    fuzz_file(read, '.yaml', mutate)
