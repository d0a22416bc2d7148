# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings, whole, truncated, damaged or forged: the readable part is shown."""

import contextlib
import functools
import importlib
import io
from pathlib import Path
import struct
from time import process_time
from types import SimpleNamespace

from hypothesis import given
from hypothesis import strategies as st
from isotruss_msgs.msg import GraspState, ManipulationStatus
from isotruss_ros.core import load_robot
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.nodes.conversions.message_text import schema_text
from isotruss_ros.viewer.message_checks import PictureError
from isotruss_ros.viewer.picture import Hold, Picture
import numpy as np
import pytest
from robots import examples
from sensor_msgs.msg import JointState

for package in ('mcap', 'rosbags', 'viser'):
    pytest.importorskip(package)
from isotruss_ros.cli import replay  # noqa: E402,I100
from isotruss_ros.viewer.panels import describe, describe_state  # noqa: E402
from isotruss_ros.viewer.recording import (  # noqa: E402
    read_recording,
    RecordingError,
    show_message,
)
from mcap.reader import make_reader  # noqa: E402
from mcap.writer import CompressionType, Writer  # noqa: E402
from rosbags.typesys import get_typestore, Stores  # noqa: E402

ROBOT = load_robot('nine_member')
SHIPPED = Path(__file__).parents[2] / 'docs' / 'images' / 'carry.mcap'
#: First bytes of an MCAP file.
MAGIC = b'\x89MCAP0\r\n'
COUNT = 40
COMPRESSIONS = ('NONE', 'LZ4', 'ZSTD')
KIND, TOPIC = 'sensor_msgs/msg/JointState', 'joint_states'
TEXT = schema_text(JointState)
few_examples = examples(100)
#: Robot of recordings without one.
NAMED = '--robot', 'nine_member'


def pack_joints(number):
    """Return joint states in CDR, whose first position is a number in tenths of a millimetre."""
    store = get_typestore(Stores.ROS2_JAZZY)
    stamp = store.types['builtin_interfaces/msg/Time'](1, 2)
    header = store.types['std_msgs/msg/Header'](stamp, 'truss')
    positions = np.array([1e-4 * number, -0.01, 0.0, 0.01, 0.0, 0.015])
    names, nothing = list(ROBOT.roller_names), np.zeros(0)
    message = store.types[KIND](header, names, positions, nothing, nothing)
    return bytes(store.serialize_cdr(message, KIND))


def write(records, compression='ZSTD', text=TEXT, encoding='cdr', name=KIND, topic=TOPIC):
    """Return a recording of messages in CDR, one each tenth of a second, in small chunks."""
    stream = io.BytesIO()
    writer = Writer(stream, chunk_size=1000, compression=CompressionType[compression])
    writer.start('ros2')
    schema = writer.register_schema(name, 'ros2msg', text.encode())
    channel = writer.register_channel(f'/arm/{topic}', encoding, schema)
    for number, record in enumerate(records):
        writer.add_message(channel, 10**8 * number, record, 0)
    writer.finish()
    return stream.getvalue()


@functools.cache
def whole(compression='ZSTD'):
    return write(map(pack_joints, range(COUNT)), compression)


def read(content, folder):
    """Return the numbers of the messages that are read of a file, and the text of its error."""
    path, numbers = folder / 'recording.mcap', []
    path.write_bytes(content)
    try:
        for time, _, message in read_recording(path):
            number = round(1e4 * message.position[0])
            assert time == pytest.approx(0.1 * number)
            numbers.append(number)
    except RecordingError as error:
        return numbers, str(error).removeprefix(str(path))
    return numbers, ''


@pytest.mark.parametrize('filled', [False, True], ids=['cut', 'zeros'])
@pytest.mark.parametrize('compression', COMPRESSIONS)
def test_a_recording_is_read_up_to_where_it_breaks_off(tmp_path, compression, filled):
    """A power cut leaves zeros in blocks that were not written."""
    content = whole(compression)
    assert read(content, tmp_path) == (list(range(COUNT)), '')

    def count_read(size):
        damaged = content[:size].ljust(len(content) if filled else 0, b'\0')
        numbers, words = read(damaged, tmp_path)
        assert numbers == list(range(len(numbers)))
        if 0 < len(numbers) < COUNT:
            ending = f' ends after {0.1 * (len(numbers) - 1):.1f} s and {len(numbers)} messages'
            assert ending in words
        assert numbers or 'holds no complete message' in words or 'no MCAP file' in words
        return len(numbers)

    @few_examples
    @given(st.integers(0, len(content)))
    def cut(size):
        count_read(size)

    cut()
    assert count_read(len(content) // 2) > COUNT // 4


@pytest.mark.parametrize('compression', COMPRESSIONS)
def test_no_message_behind_a_flipped_byte_is_altered(tmp_path, compression):
    content = whole(compression)

    @few_examples
    @given(st.integers(0, len(content) - 1), st.integers(1, 255))
    def flip(place, mask):
        changed = bytearray(content)
        changed[place] ^= mask
        numbers, words = read(bytes(changed), tmp_path)
        assert numbers == sorted(set(numbers) & set(range(COUNT)))
        assert words or len(numbers) == COUNT

    flip()


def pack(opcode, content):
    return bytes([opcode]) + struct.pack('<Q', len(content)) + content


HEADER = MAGIC + pack(1, struct.pack('<I4sI', 4, b'ros2', 0))
#: Times, size and checksum of the content of a chunk, its compression, and its data.
CHUNK = struct.pack('<QQQII4sQ4s', 0, 0, 2**62, 0, 4, b'zstd', 4, b'\x28\xb5\x2f\xfd')


@pytest.mark.parametrize(
    ('content', 'words'),
    [
        (b'', 'no MCAP file'),
        (b'rosbag2_bagfile_information:\n  version: 5\n', 'no MCAP file'),
        (HEADER + b'\x06' + struct.pack('<Q', 2**62), 'holds no complete message'),
        (HEADER + pack(6, CHUNK), 'holds no complete message'),
        (HEADER + pack(5, struct.pack('<HIQQ', 1, 0, 0, 0)), 'holds no complete message'),
    ],
    ids=['empty', 'text', 'endless record', 'endless chunk', 'message without channel'],
)
def test_a_file_that_is_no_recording_is_refused(tmp_path, content, words):
    numbers, said = read(content, tmp_path)
    assert not numbers
    assert words in said


@pytest.mark.parametrize(
    'changes',
    [
        {'text': 'no definition at all ]['},
        {'text': TEXT.replace('MSG: ', 'MSG: a/b/')},
        {'encoding': 'protobuf'},
        {'name': 'std_msgs/msg/String', 'text': 'string data'},
        {'text': 'string[] name\nfloat64[] other\n'},
    ],
)
def test_messages_that_are_no_joint_states_are_not_shown_as_such(tmp_path, capsys, changes):
    path = tmp_path / 'other.mcap'
    path.write_bytes(write([pack_joints(0)], **changes))
    replay.main([str(path), *NAMED, '--once', '--port', '0'])
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(('replay failed: ', 'replay: '))


@few_examples
@given(st.binary(max_size=100))
def test_a_message_of_random_bytes_raises_package_errors_only(tmp_path_factory, record):
    path = tmp_path_factory.getbasetemp() / 'message.mcap'
    path.write_bytes(write([b'\0\1\0\0' + record]))
    with contextlib.suppress(RecordingError, PictureError, ConfigurationError):
        for time, topic, message in read_recording(path):
            show_message(Picture(ROBOT, 0.3), topic, message, time)


def test_replay_shows_the_readable_part_and_reports_the_damage_in_one_line(tmp_path, capsys):
    path, content = tmp_path / 'half.mcap', whole()
    path.write_bytes(content[: len(content) // 2])
    assert replay.main([str(path), *NAMED, '--once', '--port', '0', '--speed', '1000']) == 0
    out, err = capsys.readouterr()
    assert out.startswith('replay: http://127.0.0.1:')
    (line,) = err.splitlines()
    assert line.startswith(f'replay: {path} ends after ')


@pytest.mark.parametrize('value', ['nan', 'inf', '-1'])
@pytest.mark.parametrize('option', ['--speed', '--diameter'])
def test_replay_refuses_numbers_out_of_range(option, value, capsys):
    assert replay.main(['none.mcap', f'{option}={value}']) == 1
    assert capsys.readouterr().err.startswith(f'replay failed: {option}')


def test_an_exported_page_plays_at_its_speed_and_names_no_server(tmp_path, capsys, monkeypatch):
    path, page, pauses = tmp_path / 'whole.mcap', tmp_path / 'whole.html', []
    path.write_bytes(whole())
    scene = SimpleNamespace(insert_sleep=pauses.append, as_html=str)
    monkeypatch.setattr('viser.ViserServer.get_scene_serializer', lambda _: scene)
    assert replay.main([str(path), *NAMED, '--page', str(page), '--speed', '2']) == 0
    assert capsys.readouterr() == (f'written: {page}\n', '')
    assert sum(pauses) == pytest.approx(0.5 * 0.1 * (COUNT - 1))


def test_a_recording_is_played_at_its_speed(tmp_path):
    path, times = tmp_path / 'whole.mcap', []
    path.write_bytes(whole())
    view = SimpleNamespace(picture=Picture(ROBOT, 0.3), update=lambda _: None)
    assert replay.replay(view, path, 2.0, times.append) == ''
    assert times[-1] == pytest.approx(0.5 * 0.1 * (COUNT - 1))


def test_the_shipped_recording_shows_a_held_object_by_the_present_message_definitions():
    picture = Picture(ROBOT, 0.3)
    for time, topic, message in read_recording(SHIPPED):
        show_message(picture, topic, message, time)
    assert picture.hold(time) is Hold.HELD
    with SHIPPED.open('rb') as stream:
        recorded = make_reader(stream).get_summary().schemas.values()
    for schema in recorded:
        package, folder, name = schema.name.split('/')
        kind = getattr(importlib.import_module(f'{package}.{folder}'), name)
        assert schema.data.decode() == schema_text(kind), (
            f'{schema.name}: run .venv/bin/python tools/pictures.py carry'
        )


def fields_of(message):
    return {name: getattr(message, name) for name in message.get_fields_and_field_types()}


STATE = fields_of(GraspState(held=GraspState.HELD_YES, utilisation=[0.1] * 9, squeeze=[5.9] * 2))
STATUS = fields_of(ManipulationStatus(code=10, squeeze=5.9, squeeze_deviation=0.3))


@pytest.mark.parametrize(
    ('topic', 'fields'), [('grasp/state', STATE), ('manipulation/status', STATUS)]
)
def test_a_picture_lacks_only_the_values_of_fields_that_a_recording_lacks(topic, fields):
    for lacking in fields.keys() - {'code'}:
        picture, message = Picture(ROBOT, 0.3), SimpleNamespace(**fields, later=1.0)
        delattr(message, lacking)
        show_message(picture, 'grasp/state', SimpleNamespace(**STATE), 0.0)
        assert show_message(picture, topic, message, 0.0) in ((), (lacking,))
        picture.sample(0.0)
        assert describe(picture, 0.0) != describe_state(picture, 0.0)
        assert picture.describe_hindrance(0.0, 1.0)
        unknown = (topic, lacking) == ('grasp/state', 'held')
        assert picture.hold(0.0) is (Hold.UNKNOWN if unknown else Hold.HELD)


def test_a_missing_field_is_reported_once_by_name(tmp_path, capsys):
    path = tmp_path / 'older.mcap'
    older = {'name': 'isotruss_msgs/msg/ManipulationStatus', 'topic': 'manipulation/status'}
    record = bytes([0, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0])
    path.write_bytes(write([record] * 3, text='uint8 code\nstring message\n', **older))
    assert replay.main([str(path), *NAMED, '--page', str(tmp_path / 'older.html')]) == 0
    reported = capsys.readouterr().err.splitlines()
    words = 'replay: /arm/manipulation/status: no field {} in this version: unknown'
    assert words.format('squeeze_deviation') in reported
    assert len(set(reported)) == len(reported)


LONG_NAMES = [f'float64 field_{number}\n' for number in range(60_000)]
BOMBS = {
    'chunk': ({}, bytes(10**8), 'chunk of'),
    'strings': ({'text': 'string[100000000] name\n'}, bytes(10**6), '100000001 values'),
    'nested': (
        {'text': f'a/Part[1000] part\n{"=" * 80}\nMSG: a/Part\nstring[1000] name\n'},
        bytes(10**6),
        'values: must have at most',
    ),
    'schema': ({'text': ''.join(LONG_NAMES)}, bytes(8), '60000 lines: must have at most'),
}


@pytest.mark.parametrize('bomb', BOMBS)
def test_a_recording_that_asks_for_too_much_is_refused_in_short_time(bomb, tmp_path):
    changes, data, words = BOMBS[bomb]
    content = write([data], **changes)
    begun = process_time()
    numbers, error = read(content, tmp_path)
    assert not numbers
    assert words in error
    assert process_time() - begun < 3.0
