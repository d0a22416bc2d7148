# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reading of recorded messages into a `Picture`, without ROS."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO

from isotruss_ros.core import IsotrussError
from isotruss_ros.core.errors import quote
from isotruss_ros.viewer.message_checks import HELD_UNKNOWN, PictureError
from isotruss_ros.viewer.picture import Picture
import lz4.frame
from mcap.records import Channel, Chunk, McapRecord, Message, Schema
from mcap.stream_reader import breakup_chunk, StreamReader
from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_msg, get_typestore, Stores
import zstandard

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
#: Largest size of a decompressed chunk [bytes], and its largest ratio to the compressed size [-];
#: the ratio holds from `MIN_BOUNDED_SIZE` on [bytes]. A writer of MCAP begins a chunk each 2^20
#: bytes; recorded carries have a ratio of 4.
MAX_CHUNK_SIZE, MAX_COMPRESSION, MIN_BOUNDED_SIZE = 2**24, 500, 2**21
#: Largest number of bytes and of lines beside comments in all schemas of a file [-].
MAX_SCHEMA_SIZE, MAX_SCHEMA_LINES = 2**18, 2000
#: Largest number of values in the arrays of fixed length of a message [-].
MAX_FIXED_VALUES = 10**5


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
    records, text = _read_messages(stream), ''
    while True:
        try:
            schema, channel, record = next(records)
            name = _find_name(channel.topic, kinds)
            is_read = name is not None and schema is not None and schema.name == kinds[name]
            if not is_read or channel.message_encoding != 'cdr':
                continue
            if schema.id not in registered:
                text += schema.data.decode()
                _check_schemas(text)
                _register(types, schema.name, schema.data.decode())
                _check_fixed_values(types, schema.name)
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


def _read_messages(stream: BinaryIO) -> Iterator[tuple[Schema | None, Channel, Message]]:
    """Yield schema, channel and message of each message of an MCAP file."""
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    reader = StreamReader(
        stream, emit_chunks=True, validate_crcs=True, record_size_limit=MAX_RECORD_SIZE
    )
    for outer in reader.records:
        for record in _decompress(outer) if isinstance(outer, Chunk) else [outer]:
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message):
                channel = channels[record.channel_id]
                yield schemas[channel.schema_id] if channel.schema_id else None, channel, record


def _decompress(chunk: Chunk) -> list[McapRecord]:
    """Return the records of a chunk, of which no more is decompressed than its bounds allow."""
    bound = min(MAX_CHUNK_SIZE, max(MIN_BOUNDED_SIZE, MAX_COMPRESSION * len(chunk.data)))
    data = chunk.data
    if chunk.compression == 'zstd':
        data = zstandard.ZstdDecompressor().stream_reader(data).read(bound + 1)
    elif chunk.compression == 'lz4':
        data = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=bound + 1)
    elif chunk.compression:
        raise RecordingError(f'compression {quote(chunk.compression)}: must be zstd or lz4')
    if len(data) > bound:
        raise RecordingError(f'chunk of {len(chunk.data)} bytes: larger than {bound} bytes')
    return breakup_chunk(replace(chunk, compression='', data=data), validate_crc=True)


def _check_schemas(text: str) -> None:
    """Raise RecordingError if the definitions of messages in a file are too long."""
    count = sum(bool(line.partition('#')[0].strip()) for line in text.splitlines())
    if len(text) > MAX_SCHEMA_SIZE or count > MAX_SCHEMA_LINES:
        raise RecordingError(
            f'schemas of {len(text)} bytes and {count} lines: must have at most {MAX_SCHEMA_SIZE} '
            f'and {MAX_SCHEMA_LINES}'
        )


def _check_fixed_values(types: Any, name: str) -> None:
    """Raise RecordingError if the arrays of fixed length of a message have too many values."""

    def count(kind: tuple[Any, Any]) -> int:
        node, content = kind
        if node == Nodetype.NAME:
            return 1 + sum(count(field) for _, field in types.fielddefs[content][1])
        if node == Nodetype.BASE:
            return 1
        return count(content[0]) * (content[1] if node == Nodetype.ARRAY else 1)

    if (number := count((Nodetype.NAME, name))) > MAX_FIXED_VALUES:
        raise RecordingError(f'{name} has {number} values: must have at most {MAX_FIXED_VALUES}')


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
