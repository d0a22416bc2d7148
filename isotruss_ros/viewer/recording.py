# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reading of recorded messages into a `Picture`, without ROS."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO

from isotruss_ros.core import IsotrussError
from isotruss_ros.viewer.message_checks import HELD_UNKNOWN, PictureError
from isotruss_ros.viewer.picture import Picture
from mcap.reader import NonSeekingReader
from rosbags.typesys import get_types_from_msg, get_typestore, Stores

#: First bytes of an MCAP file.
MAGIC = b'\x89MCAP0\r\n'
#: Text between the message definitions in a schema, and text before the name of each definition.
SEPARATOR, NAME = '=' * 80 + '\n', 'MSG: '
#: Type of a message, and method of `Picture` that receives it, by the end of the topic's name.
RECEIVERS = {
    'joint_states': ('sensor_msgs/msg/JointState', Picture.receive_joint_states),
    'object_pose': ('geometry_msgs/msg/PoseStamped', Picture.receive_object_pose),
    'grasp/state': ('isotruss_msgs/msg/GraspState', Picture.receive_state),
    'grasp/markers': ('visualization_msgs/msg/MarkerArray', Picture.receive_markers),
    'manipulation/status': ('isotruss_msgs/msg/ManipulationStatus', Picture.receive_status),
    'manipulation/cycle': ('std_msgs/msg/String', Picture.receive_cycle),
    'planned_path': ('nav_msgs/msg/Path', Picture.receive_path),
}
#: Types of the messages that a view shows, by the end of the topic's name.
SHOWN = {name: kind for name, (kind, _) in RECEIVERS.items()}
#: Values of fields that a recording of another version lacks, by the type of the message.
UNKNOWN_VALUES: dict[str, dict[str, Any]] = {
    'isotruss_msgs/msg/GraspState': {
        'message': '',
        'held': HELD_UNKNOWN,
        'force_closure': None,
        'hold_message': '',
        'slip_margin': math.nan,
        'chance': math.nan,
        'slip_direction': (0.0, 0.0, 0.0),
        'utilisation': None,
        'squeeze': (),
    },
    'isotruss_msgs/msg/ManipulationStatus': {
        'message': '',
        'scale': math.nan,
        'squeeze': math.nan,
        'squeeze_deviation': math.nan,
        'squeeze_assumed': False,
    },
}
#: Largest size of a record [bytes]; a larger size in a file shows that the file is damaged.
MAX_RECORD_SIZE = 2**30


class RecordingError(IsotrussError, ValueError):
    """Error: a recording contains no messages that can be displayed."""


class BrokenRecordingError(RecordingError):
    """Error: a recording is damaged; the part before the damage was read."""


def read_recording(
    path: str | Path, kinds: Mapping[str, str] = SHOWN
) -> Iterator[tuple[float, str, Any]]:
    """
    Yield (time [s], topic, message) for each message of some topics of an MCAP file.

    A truncated or damaged file is read up to the damage. The index at the end of the file is not
    used.

    :param kinds: types of the messages by the end of the topic's name.
    """
    count, first, last = 0, 0.0, 0.0
    fault = None
    try:
        with Path(path).open('rb') as stream:
            if stream.read(len(MAGIC)) != MAGIC:
                raise RecordingError(f'{path}: no MCAP file: record one by the node record')
            stream.seek(0)
            for item in _decode(stream, kinds):
                if isinstance(item, str):
                    fault = item
                    break
                last = item[0]
                first = last if not count else first
                count += 1
                yield item
    except OSError as error:
        raise RecordingError(f'{path}: cannot be read: {error.strerror or error}') from error
    if not count:
        raise RecordingError(
            f'{path}: holds no complete message of {", ".join(kinds)}'
            + (f' ({fault})' if fault else '')
        )
    if fault is not None:
        raise BrokenRecordingError(
            f'{path} ends after {last - first:.1f} s and {count} messages: the rest cannot be '
            f'read ({fault})'
        )


def _decode(stream: BinaryIO, kinds: Mapping[str, str]) -> Iterator[tuple[float, str, Any] | str]:
    """Yield time [s], topic and message for each message of `kinds`; at damage, its cause."""
    types = get_typestore(Stores.EMPTY)
    registered: set[int] = set()
    reader = NonSeekingReader(stream, True, record_size_limit=MAX_RECORD_SIZE)
    records = reader.iter_messages(log_time_order=False)
    while True:
        try:
            schema, channel, record = next(records)
            name = _find_name(channel.topic, kinds)
            is_read = name is not None and schema is not None and schema.name == kinds[name]
            if not is_read or channel.message_encoding != 'cdr':
                continue
            if schema.id not in registered:
                _register(types, schema.name, schema.data.decode())
                registered.add(schema.id)
            message = types.deserialize_cdr(record.data, schema.name)
        except StopIteration:
            return
        except OSError:
            raise
        # Any exception of the decoders of records, compressions and messages on damaged bytes.
        except Exception as error:  # noqa: BLE001
            yield f'{type(error).__name__}: {error}'
            return
        yield 1e-9 * record.log_time, channel.topic, message


def show_message(picture: Picture, topic: str, message: Any, now: float) -> tuple[str, ...]:
    """
    Update a picture from a message; return the names of fields that its version lacks.

    The values of these fields are unknown. Fields that a picture does not use are ignored.
    """
    kind, receive = RECEIVERS[_find_name(topic, SHOWN)]
    unknown = UNKNOWN_VALUES.get(kind, {})
    try:
        receive(picture, SimpleNamespace(**unknown | vars(message)), now)
    except AttributeError as error:  # a definition of another version
        raise PictureError(f'message without the field {error.name}') from error
    return tuple(name for name in unknown if not hasattr(message, name))


def _find_name(topic: str, kinds: Mapping[str, str]) -> str | None:
    """Return the name at the end of a topic; None if it is none of `kinds`."""
    names = (name for name in kinds if topic == name or topic.endswith(f'/{name}'))
    return next(names, None)


def _register(types: Any, name: str, text: str) -> None:
    """Register those message definitions of a schema that are not registered yet."""
    first, *others = text.split(SEPARATOR)
    definitions = {name: first}
    for part in others:
        heading, _, body = part.partition('\n')
        package, short = heading.removeprefix(NAME).strip().split('/')
        definitions[f'{package}/msg/{short}'] = body
    for full, body in definitions.items():
        if full not in types.fielddefs:
            types.register(get_types_from_msg(body, full))
