# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Make outdated pictures, films and recordings of the README and the site again.

    python tools/pictures.py [NAME ...]     make outdated pictures, all or those named
    python tools/pictures.py --check        fail if a picture is outdated
    python tools/pictures.py --keep NAME    mark a picture as up to date

docs/images/inputs.json contains a hash of the sources of each picture without comments and
docstrings, and the words in the drawings. A check computes these words again; their numbers may
differ by 5 %.
"""

from __future__ import annotations

import argparse
import ast
from collections.abc import Callable, Sequence
from dataclasses import dataclass
import hashlib
import json
import math
from pathlib import Path
import re
import subprocess
import sys

TOP = Path(__file__).resolve().parents[1]
HASHES = TOP / 'docs' / 'images' / 'inputs.json'
#: Folder of the demonstration's output.
OUTPUT = TOP / '.venv' / 'pictures'
ROBOT = 'config/nine_member.yaml'
PANELS = 'docs/images/demo.png'
#: Relative tolerance of numbers in words, which are rounded.
TOLERANCE = 0.05
NUMBER = re.compile(r'\d+(?:\.\d+)?')


def _words_of_drawings() -> list[str]:
    sys.path.insert(0, str(TOP / 'docs' / '_ext'))
    import drawings

    return drawings.list_words()


def _words_of_panels() -> list[str]:
    """Return the words of the demonstration's panels in all pictured states."""
    from isotruss_ros.core import ConvexObject, load_robot
    from isotruss_ros.demo.figures import settle
    from PIL import Image

    with Image.open(TOP / PANELS) as picture:
        shown = json.loads(picture.info['Description'])
    robot, words = load_robot(shown['robot']), []
    for panel in shown['panels']:
        body = ConvexObject.disc(panel['pose'][:2], shown['diameter'])
        config = robot.configuration(panel['rollers'])
        words.append(settle(config, body, panel['pull'])[1])
    return words


@dataclass(frozen=True)
class Picture:
    """One picture, or several pictures that one command makes."""

    files: tuple[str, ...]  #: what is committed
    command: tuple[str, ...]  #: arguments of Python
    inputs: tuple[str, ...]  #: files and folders that draw it, and what they draw
    made: tuple[str, ...] = ()  #: where the command writes `files`, if elsewhere
    words: Callable[[], list[str]] | None = None  #: returns words that it would show today


DRAWING = ('isotruss_ros/plotting/grasp_drawing.py', 'isotruss_ros/plotting/robot_drawing.py')
PATH = 'isotruss_ros/demo/path.py'
VIEW = (
    'browser_panel',
    'camera',
    'controls',
    'meshes',
    'obstacle_controls',
    'obstacle_drawing',
    'panels',
    'scene',
)
PICTURES = {
    'drawings': Picture(
        tuple(
            f'docs/images/{name}'
            for name in ('robot.svg', 'robot.png', 'held_object.svg', 'closure.svg')
        ),
        ('docs/_ext/drawings.py',),
        ('docs/_ext/drawings.py', *DRAWING, ROBOT, 'config/triangle.yaml'),
        words=_words_of_drawings,
    ),
    'chance': Picture(
        ('docs/images/chance_map.png',),
        ('examples/chance_map.py',),
        ('examples/chance_map.py', *DRAWING, ROBOT),
        ('chance_map.png',),
    ),
    'panels': Picture(
        (PANELS,),
        ('-m', 'isotruss_ros.demo', '--output', f'{OUTPUT}'),
        ('isotruss_ros/demo/figures.py', PATH, *DRAWING, ROBOT),
        (f'{OUTPUT}/demo.png',),
        _words_of_panels,
    ),
    'film': Picture(
        ('docs/images/demo.gif',),
        ('-m', 'isotruss_ros.demo', '--plant', 'mujoco', '--output', f'{OUTPUT}-mujoco'),
        (
            'isotruss_ros/demo/film.py',
            PATH,
            'isotruss_ros/mujoco_plant/rendering.py',
            'isotruss_ros/mujoco_plant/scenery.py',
            ROBOT,
        ),
        (f'{OUTPUT}-mujoco/demo.gif',),
    ),
    **{
        scene: Picture(
            (f'docs/images/{scene}.gif',),
            ('tools/film_viewer.py', scene, f'docs/images/{scene}.gif'),
            (
                'tools/browser_film.py',
                'tools/film_viewer.py',
                *(f'isotruss_ros/viewer/{name}.py' for name in VIEW),
                ROBOT,
            ),
        )
        for scene in ('viewer', 'obstacles')
    },
    'carry': Picture(
        ('docs/images/carry.mcap',),
        ('tools/record_carry.py', 'docs/images/carry.mcap'),
        (
            'tools/record_carry.py',
            *(f'msg_defs/msg/{name}.msg' for name in ('GraspState', 'ManipulationStatus')),
            ROBOT,
        ),
    ),
    'paper': Picture(
        tuple(f'docs/paper/figure_{number}.png' for number in (4, 5, 6, 7, 9)),
        ('-m', 'studies.paper'),
        (
            *(f'studies/paper/figure_{number}_drawing.py' for number in (4, 5, 6, 7, 9)),
            'studies/paper/style.py',
            'isotruss_ros/plotting/robot_drawing.py',
        ),
    ),
    'plant': Picture(
        ('docs/plant/boxes.png', 'docs/plant/carried.png'),
        ('-m', 'studies.comparison'),
        (
            'studies/comparison/box_picked.py',
            'studies/comparison/carried.py',
            'studies/paper/style.py',
            *DRAWING,
        ),
    ),
}


def hash_inputs(inputs: Sequence[str]) -> str:
    """Return a hash of the content of files, without comments and docstrings."""
    digest = hashlib.sha256()
    for name in sorted(inputs):
        path = TOP / name
        for file in sorted(path.rglob('*.py')) if path.is_dir() else [path]:
            digest.update(file.relative_to(TOP).as_posix().encode() + b'\0')
            digest.update(_read(file) + b'\0')
    return digest.hexdigest()[:16]


def _read(file: Path) -> bytes:
    if file.suffix == '.msg':
        lines = (line.partition('#')[0].rstrip() for line in file.read_text().splitlines())
        return '\n'.join(filter(None, lines)).encode()
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


def find_stale() -> dict[str, str]:
    """Return the names of outdated pictures, each with the reason in words."""
    known, stale = _read_known(), {}
    for name, picture in PICTURES.items():
        if not all((TOP / file).exists() for file in picture.files):
            stale[name] = 'not there'
        elif known.get(name, {}).get('inputs') != hash_inputs(picture.inputs):
            stale[name] = 'older than what draws it'
        elif picture.words and (words := _changed(known[name]['words'], picture.words())):
            stale[name] = f'shows {words}'
    return stale


def _changed(was: Sequence[str], now: Sequence[str]) -> str:
    """Return the first words that have changed; empty without a change."""
    if len(was) != len(now):
        return f'{len(was)} words, today there are {len(now)}'
    for old, new in zip(was, now, strict=True):
        same = NUMBER.split(old) == NUMBER.split(new)
        pairs = zip(NUMBER.findall(old), NUMBER.findall(new), strict=True) if same else ()
        if not same or not all(_is_close(*pair) for pair in pairs):
            return f'{old!r}, today it is {new!r}'
    return ''


def _is_close(old: str, new: str) -> bool:
    last = 10.0 ** -len(old.partition('.')[2])
    return math.isclose(float(old), float(new), rel_tol=TOLERANCE, abs_tol=1.01 * last)


def make(name: str) -> None:
    """Make a picture, and store the hash of its inputs."""
    picture = PICTURES[name]
    subprocess.run([sys.executable, *picture.command], cwd=TOP, check=True)
    for file, made in zip(picture.files, picture.made or picture.files, strict=True):
        if file != made:
            (TOP / file).write_bytes(Path(made).read_bytes())
    note(name)


def note(name: str) -> None:
    """Store the hash of the inputs of a picture, and its words."""
    known, picture = _read_known(), PICTURES[name]
    known[name] = {'inputs': hash_inputs(picture.inputs)}
    if picture.words is not None:
        known[name]['words'] = picture.words()
    HASHES.write_text(json.dumps(known, indent=2, sort_keys=True, ensure_ascii=False) + '\n')


def _read_known() -> dict[str, dict]:
    return json.loads(HASHES.read_text()) if HASHES.exists() else {}


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Make, check or keep the pictures.

    :return: 1 if `--check` finds an outdated picture, else 0.
    """
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument(
        'names', nargs='*', help='pictures to make; without names all outdated ones'
    )
    parser.add_argument('--check', action='store_true', help='only fail where one is out of date')
    parser.add_argument('--keep', nargs='+', default=[], choices=PICTURES, help='as they are')
    options = parser.parse_args(arguments)
    if unknown := set(options.names) - PICTURES.keys():
        parser.error(f'{", ".join(sorted(unknown))}: must be of {", ".join(PICTURES)}')
    for name in options.keep:
        note(name)
    if options.keep:
        return 0
    stale = find_stale()
    if options.names:
        stale = {name: why for name, why in stale.items() if name in options.names}
    for name, why in stale.items():
        if options.check:
            files = ', '.join(PICTURES[name].files)
            remedy = f'run .venv/bin/python tools/pictures.py {name}'
            print(f'{files}: {why}: {remedy}', file=sys.stderr)
        else:
            print(f'== {name}: {why}', flush=True)
            make(name)
    return int(options.check and bool(stale))


if __name__ == '__main__':
    sys.exit(main())
