# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages of a recording, read without ROS, into a picture."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import os
from pathlib import Path
import struct
from typing import Any, BinaryIO

from isotruss_ros.core import IsotrussError
from isotruss_ros.viewer.picture import Picture
from mcap.exceptions import EndOfFile, McapError
from mcap.reader import make_reader, NonSeekingReader
from mcap.writer import MCAP0_MAGIC
from rosbags.typesys import get_types_from_msg, get_typestore, Stores

#: Between the definitions in a schema, and what stands before the name of one.
SEPARATOR, NAME = '=' * 80 + '\n', 'MSG: '
#: By the end of a topic's name: what the picture does with a message.
RECEIVERS = {
    'joint_states': Picture.receive_joint_states,
    'object_pose': Picture.receive_object_pose,
    'grasp/state': Picture.receive_state,
    'grasp/markers': Picture.receive_markers,
    'manipulation/status': Picture.receive_status,
}


class RecordingError(IsotrussError, ValueError):
    """A recording cannot be read."""


def read_recording(path: Path) -> Iterator[tuple[float, str, Any]]:
    """
    Yield (time [s], topic, message) of an MCAP file in the order of time.

    Of a file whose writer was killed, or had no room, it yields what is complete, in the order in
    which it was recorded.

    :param path: of the file.
    :raises RecordingError: it cannot be read, has messages of another encoding than CDR, or none.
    """
    types = get_typestore(Stores.EMPTY)
    known: set[int] = set()
    finished = is_finished(path)
    try:
        with path.open('rb') as stream:
            for schema, channel, message in _read_messages(stream, finished):
                if schema is None or channel.message_encoding != 'cdr':
                    raise RecordingError(f'{path}: topic {channel.topic} holds no ROS messages')
                if schema.id not in known:
                    _register(types, schema.name, schema.data.decode())
                    known.add(schema.id)
                content = types.deserialize_cdr(message.data, schema.name)
                yield 1e-9 * message.log_time, channel.topic, content
    except (OSError, McapError) as error:
        raise RecordingError(f'{path}: {error}') from error
    if not known:
        raise RecordingError(f'{path}: holds no complete message')


def is_finished(path: Path) -> bool:
    """
    Return whether the writer of an MCAP file finished it.

    :param path: of the file.
    :raises RecordingError: it cannot be read.
    """
    try:
        with path.open('rb') as stream:
            size = stream.seek(0, os.SEEK_END)
            stream.seek(max(0, size - len(MCAP0_MAGIC)))
            # A file that holds only its first bytes ends as a finished one does.
            return size > len(MCAP0_MAGIC) and stream.read() == MCAP0_MAGIC
    except OSError as error:
        raise RecordingError(f'{path}: {error.strerror}') from error


def _read_messages(stream: BinaryIO, finished: bool) -> Iterator[tuple[Any, Any, Any]]:
    """Yield (schema, channel, message) of a file, up to where it breaks off."""
    if finished:
        yield from make_reader(stream).iter_messages()
        return
    # Sorting by time would read all of it at first.
    with contextlib.suppress(EndOfFile, struct.error):
        yield from NonSeekingReader(stream).iter_messages(log_time_order=False)


def show_message(picture: Picture, topic: str, message: Any, now: float) -> None:
    """
    Put a message into a picture; topics that the view does not show are ignored.

    :param picture: receives it.
    :param topic: with or without namespace.
    :param message: with the fields of the ROS message.
    :param now: time of the message [s].
    :raises ConfigurationError: no configuration of the robot fits the joint states.
    """
    for name, receive in RECEIVERS.items():
        if topic == name or topic.endswith(f'/{name}'):
            receive(picture, message, now)


def _register(types: Any, name: str, text: str) -> None:
    """Add the definitions of a schema that are not known yet."""
    first, *others = text.split(SEPARATOR)
    definitions = {name: first}
    for part in others:
        heading, _, body = part.partition('\n')
        package, short = heading.removeprefix(NAME).strip().split('/')
        definitions[f'{package}/msg/{short}'] = body
    for full, body in definitions.items():
        if full not in types.fielddefs:
            types.register(get_types_from_msg(body, full))
