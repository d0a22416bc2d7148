# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Executable `replay`, which plays a recording in a browser, exports it, or decides it again."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
import contextlib
from dataclasses import replace
import math
from pathlib import Path
import sys
import time
from typing import TYPE_CHECKING

from isotruss_ros import core
from isotruss_ros.core.errors import ConfigurationError, IsotrussError
from isotruss_ros.core.model.pose import check_range, MAX_SIZE, MIN_DIAMETER
from isotruss_ros.extras import MissingPackageError
from isotruss_ros.viewer.names import LOCAL

if TYPE_CHECKING:
    from isotruss_ros.core.model.shapes import Shape
    from isotruss_ros.viewer.view import View

#: Robot of a recording that contains none, unless another one is given.
ROBOT = 'nine_member'
#: Rate of displayed frames [Hz].
FRAME_RATE = 20.0
#: Smallest and largest speed of the playback relative to the recording [-].
SPEED_RANGE = 1e-3, 1e3
#: Exit code if commands that are decided again differ; argparse exits with 2 for bad arguments.
DIFFERENT = 3


def replay(view: View, path: Path, speed: float, wait: Callable[[float], None]) -> str:
    """
    Show a recording once; return a sentence about damage that ended it early, or ''.

    :param speed: speed of the playback relative to the recording [-].
    :param wait: function called after each frame with the time from the start at which the next
        frame is due [s].
    """
    from isotruss_ros.viewer.message_checks import PictureError
    from isotruss_ros.viewer.recording import BrokenRecordingError, read_recording, show_message

    shown, first = -math.inf, None
    notices: set[tuple[str, ...]] = set()

    def print_once(subject: tuple[str, ...], text: str) -> None:
        if subject not in notices:
            print(f'replay: {subject[0]}: {text}', file=sys.stderr)
        notices.add(subject)

    try:
        for now, topic, message in read_recording(path):
            first = now if first is None else first
            try:
                lacking = show_message(view.picture, topic, message, now)
            except (ConfigurationError, PictureError) as error:
                print_once((topic,), str(error))
            else:
                for name in lacking:
                    print_once((topic, name), f'no field {name} in this version: unknown')
            if now - shown >= speed / FRAME_RATE:
                view.update(now)
                shown = now
                wait((now - first) / speed)
    except BrokenRecordingError as error:
        return str(error)
    return ''


def _wait_on_the_wall() -> Callable[[float], None]:
    """Return a function that sleeps until a given time [s] has passed since this call."""
    began = time.monotonic()
    return lambda end: time.sleep(max(0.0, end - (time.monotonic() - began)))


def _write_page(view: View, path: Path, speed: float, page: Path) -> None:
    """Write a page that plays a recording without a server or network."""
    scene, written = view.server.get_scene_serializer(), 0.0

    def keep(end: float) -> None:
        nonlocal written
        scene.insert_sleep(end - written)
        written = end

    end = replay(view, path, speed, keep)
    if end:
        print(f'replay: {end}', file=sys.stderr)
    page.write_text(scene.as_html(), encoding='utf-8')


def _repeat(view: View, options: argparse.Namespace) -> None:
    """Show a recording once or repeatedly until Ctrl-C; print once if it is damaged."""
    printed = ''
    while True:
        end = replay(view, options.file, options.speed, _wait_on_the_wall())
        if end != printed:
            print(f'replay: {end}', file=sys.stderr)
            printed = end
        if options.once:
            return
        view.picture.samples.clear()


def _read_setup(options: argparse.Namespace) -> tuple[core.Robot, Shape | None]:
    """Return robot and shape of a recording; the robot of the options if it contains none."""
    from isotruss_ros.core.recording.encoded_values import RecordedCycleError
    from isotruss_ros.viewer.recorded_cycles import read_setup

    try:
        recorded, shape = read_setup(options.file)
    except RecordedCycleError as error:  # messages beside the cycles can still be shown
        print(f'replay: {error}', file=sys.stderr)
        recorded = shape = None
    if recorded is None:
        if options.robot is None:
            print(f'replay: the recording contains no robot: {ROBOT}, or --robot', file=sys.stderr)
        return core.load_robot(options.robot or ROBOT), shape
    if options.robot is not None:
        given = replace(core.load_robot(options.robot).description, source='')
        if repr(given) != repr(replace(recorded.description, source='')):
            words = f'--robot {options.robot}: not the robot of the recording, which is used'
            print(f'replay: {words}: {recorded.name}', file=sys.stderr)
    return recorded, shape


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Show a recording repeatedly until Ctrl-C, or write a page that plays it.

    :return: 0 after Ctrl-C or after the page was written, 1 if the recording cannot be shown,
        `DIFFERENT` if commands that are decided again differ from the recorded ones.
    """
    parser = argparse.ArgumentParser(
        prog='isotruss replay',
        description=__doc__,
        epilog='exit codes: 0 shown, written or equal commands, 1 failed for the printed reason, '
        '2 bad arguments, 3 commands that are decided again differ',
    )
    parser.add_argument('file', type=Path, help='MCAP file of the node record')
    parser.add_argument(
        '--robot',
        help='name of a preset, or path of a robot file, for a recording that contains no robot '
        f'(default {ROBOT})',
    )
    parser.add_argument(
        '--diameter',
        type=float,
        default=0.3,
        help='diameter of the object [m], for a recording that contains no object',
    )
    parser.add_argument('--speed', type=float, default=1.0, help='playback speed, 1: as recorded')
    parser.add_argument('--port', type=int, default=8080, help='port of the server')
    parser.add_argument('--once', action='store_true', help='play the recording only once')
    parser.add_argument('--page', type=Path, help='HTML file to write instead')
    parser.add_argument(
        '--decide',
        action='store_true',
        help='compute the run again; print halts, slowings, and differences from the recorded '
        'commands',
    )
    parser.add_argument(
        '--set',
        action='append',
        default=[],
        metavar='NAME=VALUE',
        help='with --decide: another value of a setting, such as squeeze.force=40',
    )
    options = parser.parse_args(arguments)
    if options.set and not options.decide:
        parser.error('--set needs --decide')
    for name in ('speed', 'port', 'once', 'page'):
        if options.decide and getattr(options, name) != parser.get_default(name):
            parser.error(f'--{name} with --decide: nothing is shown; must be omitted')
    try:
        check_range(options.speed, '--speed', '', *SPEED_RANGE)
        check_range(options.diameter, '--diameter', 'm', MIN_DIAMETER, MAX_SIZE)
        if options.decide:
            try:
                from isotruss_ros.cli.decide_again import print_run
            except ModuleNotFoundError as error:
                raise MissingPackageError(error) from error
            robot, _ = _read_setup(options)
            is_equal = print_run(options.file, robot, options.diameter, options.set)
            return 0 if is_equal else DIFFERENT
        try:
            from isotruss_ros.viewer.picture import Picture
            from isotruss_ros.viewer.recording import read_recording
            from isotruss_ros.viewer.view import View
        except ModuleNotFoundError as error:
            raise MissingPackageError(error) from error
        next(read_recording(options.file))  # refused before an address is printed
        robot, shape = _read_setup(options)
        diameter = shape.diameter if isinstance(shape, core.Disc) else options.diameter
        # Writing needs no fixed port.
        port = options.port if options.page is None else 0
        with contextlib.closing(View(Picture(robot, diameter, shape), LOCAL, port)) as view:
            if options.page is not None:
                _write_page(view, options.file, options.speed, options.page)
                print(f'written: {options.page}')
            else:
                print(f'replay: {view.address}', flush=True)
                _repeat(view, options)
    except (IsotrussError, OSError) as error:
        print(f'replay failed: {error}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        pass
    return 0


if __name__ == '__main__':
    sys.exit(main())
