# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Make the pictures and films of README and site anew where what draws them has changed.

    python tools/pictures.py          makes those that are out of date
    python tools/pictures.py --check    fails where one is

docs/images/inputs.json keeps a hash of the inputs of each as it was made: the code that draws,
without comments, and the robot; not the core, whose numbers tests compare.
"""

from __future__ import annotations

import ast
from collections.abc import Sequence
from dataclasses import dataclass
import hashlib
import json
from pathlib import Path
import subprocess
import sys

TOP = Path(__file__).resolve().parents[1]
HASHES = TOP / 'docs' / 'images' / 'inputs.json'
#: Where the demonstration writes.
OUTPUT = TOP / '.venv' / 'pictures'
ROBOT = 'config/nine_member.yaml'


@dataclass(frozen=True)
class Picture:
    """A picture, or several that are made at once."""

    files: tuple[str, ...]  #: what is committed
    command: tuple[str, ...]  #: arguments of Python
    inputs: tuple[str, ...]  #: files and folders whose content decides how it looks
    made: tuple[str, ...] = ()  #: where the command writes `files`, if elsewhere


DEMO = ('isotruss_ros/demo', 'isotruss_ros/plotting', ROBOT)
PICTURES = {
    'drawings': Picture(
        (
            'docs/images/robot.svg',
            'docs/images/robot.png',
            'docs/images/held_object.svg',
            'docs/images/closure.svg',
        ),
        ('docs/_ext/drawings.py',),
        ('docs/_ext/drawings.py', 'isotruss_ros/plotting', ROBOT, 'config/triangle.yaml'),
    ),
    'panels': Picture(
        ('docs/images/demo.png',),
        ('-m', 'isotruss_ros.demo', '--output', f'{OUTPUT}'),
        DEMO,
        (f'{OUTPUT}/demo.png',),
    ),
    'film': Picture(
        ('docs/images/demo.gif',),
        ('-m', 'isotruss_ros.demo', '--plant', 'mujoco', '--output', f'{OUTPUT}-mujoco'),
        (*DEMO, 'isotruss_ros/mujoco_plant/rendering.py', 'isotruss_ros/mujoco_plant/scenery.py'),
        (f'{OUTPUT}-mujoco/demo.gif',),
    ),
    'viewer': Picture(
        ('docs/images/viewer.gif',),
        ('tools/film_viewer.py', 'docs/images/viewer.gif'),
        ('tools/film_viewer.py', 'isotruss_ros/viewer', ROBOT),
    ),
    'paper': Picture(
        tuple(f'docs/paper/figure_{number}.png' for number in (4, 5, 6, 7, 9)),
        ('-m', 'paper'),
        ('paper', 'isotruss_ros/plotting'),
    ),
    'plant': Picture(
        ('docs/plant/boxes.png', 'docs/plant/carried.png'),
        ('-m', 'comparison'),
        ('comparison', 'isotruss_ros/plotting'),
    ),
}


def hash_inputs(inputs: Sequence[str]) -> str:
    """
    Return a hash of the content of files, that of Python without comments and docstrings.

    :param inputs: files and folders, from the top of the sources.
    """
    digest = hashlib.sha256()
    for name in sorted(inputs):
        path = TOP / name
        for file in sorted(path.rglob('*.py')) if path.is_dir() else [path]:
            digest.update(file.relative_to(TOP).as_posix().encode() + b'\0')
            digest.update(_read(file) + b'\0')
    return digest.hexdigest()[:16]


def _read(file: Path) -> bytes:
    if file.suffix != '.py':
        return file.read_bytes()
    tree = ast.parse(file.read_text(encoding='utf-8'))
    for node in ast.walk(tree):
        body = getattr(node, 'body', None)
        if isinstance(body, list) and body and isinstance(body[0], ast.Expr):
            value = body[0].value
            if isinstance(value, ast.Constant) and isinstance(value.value, str):
                value.value = ''
    return ast.unparse(tree).encode()


def find_stale() -> list[str]:
    """Return the names of the pictures that were made of other inputs, or are not there."""
    known = json.loads(HASHES.read_text()) if HASHES.exists() else {}
    return [
        name
        for name, picture in PICTURES.items()
        if known.get(name) != hash_inputs(picture.inputs)
        or not all((TOP / file).exists() for file in picture.files)
    ]


def make(name: str) -> None:
    """
    Make a picture, and keep the hash of its inputs.

    :param name: one of `PICTURES`.
    """
    picture = PICTURES[name]
    subprocess.run([sys.executable, *picture.command], cwd=TOP, check=True)
    for file, made in zip(picture.files, picture.made or picture.files, strict=True):
        if file != made:
            (TOP / file).write_bytes(Path(made).read_bytes())
    note(name)


def note(name: str) -> None:
    """
    Keep the hash of the inputs of a picture that was made just now.

    :param name: one of `PICTURES`.
    """
    known = json.loads(HASHES.read_text()) if HASHES.exists() else {}
    known[name] = hash_inputs(PICTURES[name].inputs)
    HASHES.write_text(json.dumps(known, indent=2, sort_keys=True) + '\n')


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Make or check the pictures.

    :param arguments: of the command line; those of the process if None.
    :return: 1 where `--check` finds one that is out of date.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    stale = find_stale()
    if '--check' in arguments:
        for name in stale:
            files = ', '.join(PICTURES[name].files)
            print(f'{files}: older than what draws it: make pictures', file=sys.stderr)
        return int(bool(stale))
    for name in stale:
        print(f'== {name}', flush=True)
        make(name)
    return 0


if __name__ == '__main__':
    sys.exit(main())
