# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings, whole, broken off, damaged or made up: what is readable is played."""

import contextlib
import functools
import importlib
import importlib.util
import io
from pathlib import Path
import struct
from types import SimpleNamespace

from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core import load_robot
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.nodes.conversions.message_text import schema_text
from isotruss_ros.viewer.message_checks import PictureError
from isotruss_ros.viewer.picture import Hold, Picture
import numpy as np
import pytest
from robots import examples
from sensor_msgs.msg import JointState

pytestmark = pytest.mark.skipif(
    not all(map(importlib.util.find_spec, ('mcap', 'rosbags', 'viser'))),
    reason='needs mcap, rosbags and viser',
)
ROBOT = load_robot('nine_member')
TOP = Path(__file__).parents[2]
#: Recordings that the sources contain.
SHIPPED = sorted(
    path
    for folder in ('docs', 'examples', 'test', 'studies')
    for path in (TOP / folder).rglob('*.mcap')
    if '_build' not in path.parts
)
#: With which MCAP files begin and end.
MAGIC = b'\x89MCAP0\r\n'
COUNT = 40
few_examples = examples(100)
COMPRESSIONS = ('NONE', 'LZ4', 'ZSTD')
JOINT_STATE = 'sensor_msgs/msg/JointState'


def pack_joints(number):
    """Return joint states, in CDR, whose first position tells their number."""
    from rosbags.typesys import get_typestore, Stores

    store = get_typestore(Stores.ROS2_JAZZY)
    header = store.types['std_msgs/msg/Header'](
        store.types['builtin_interfaces/msg/Time'](1, 2), 'truss'
    )
    positions = np.array([1e-4 * number, -0.01, 0.0, 0.01, 0.0, 0.015])
    message = store.types[JOINT_STATE](
        header, list(ROBOT.roller_names), positions, np.zeros(0), np.zeros(0)
    )
    return bytes(store.serialize_cdr(message, JOINT_STATE))


def write(
    records,
    compression='ZSTD',
    text=None,
    encoding='cdr',
    name=JOINT_STATE,
    topic='joint_states',
):
    """Return a recording of messages in CDR, one each tenth of a second, in small chunks."""
    from mcap.writer import CompressionType, Writer

    stream = io.BytesIO()
    writer = Writer(stream, chunk_size=1000, compression=CompressionType[compression])
    writer.start('ros2')
    text = schema_text(JointState) if text is None else text
    schema = writer.register_schema(name, 'ros2msg', text.encode())
    channel = writer.register_channel(f'/arm/{topic}', encoding, schema)
    for number, record in enumerate(records):
        writer.add_message(channel, 10**8 * number, record, 0)
    writer.finish()
    return stream.getvalue()


@functools.cache
def whole(compression):
    """Return a recording of numbered joint states."""
    return write(map(pack_joints, range(COUNT)), compression)


def read(content, folder):
    """Return the numbers of the messages that are read of a file, and in which words it ends."""
    from isotruss_ros.viewer.recording import read_recording, RecordingError

    path, numbers = folder / 'recording.mcap', []
    path.write_bytes(content)
    try:
        for time, _, message in read_recording(str(path)):
            number = round(1e4 * message.position[0])
            assert time == pytest.approx(0.1 * number)
            numbers.append(number)
    except RecordingError as error:
        return numbers, str(error).removeprefix(str(path))
    return numbers, ''


@pytest.mark.parametrize('compression', COMPRESSIONS)
def test_a_whole_recording_is_read_in_full(tmp_path, compression):
    assert read(whole(compression), tmp_path) == (list(range(COUNT)), '')


def check_beginning(content, tmp_path):
    """Check that the messages of a file are the first of a whole one, or that it says that not."""
    numbers, words = read(content, tmp_path)
    assert numbers == list(range(len(numbers)))
    if numbers and len(numbers) < COUNT:
        assert f' ends after {0.1 * (len(numbers) - 1):.1f} s and {len(numbers)} messages' in words
    assert numbers or 'holds no complete message' in words or 'no MCAP file' in words
    return len(numbers)


@pytest.mark.parametrize('filled', [False, True], ids=['cut', 'zeros'])
@pytest.mark.parametrize('compression', COMPRESSIONS)
def test_a_recording_is_read_up_to_where_it_breaks_off(tmp_path, compression, filled):
    """Also as a power cut leaves a file, with zeros in blocks that were not written."""
    content = whole(compression)
    full = len(content) if filled else 0

    @few_examples
    @given(st.integers(0, len(content)))
    def cut(size):
        check_beginning(content[:size].ljust(full, b'\0'), tmp_path)

    cut()
    half = content[: len(content) // 2].ljust(full, b'\0')
    assert check_beginning(half, tmp_path) > COUNT // 4


@pytest.mark.parametrize('compression', COMPRESSIONS)
def test_no_message_behind_a_flipped_byte_is_altered(tmp_path, compression):
    content = whole(compression)

    @few_examples
    @given(st.integers(0, len(content) - 1), st.integers(1, 255))
    def flip(place, mask):
        changed = bytearray(content)
        changed[place] ^= mask
        numbers, words = read(bytes(changed), tmp_path)
        assert numbers == sorted(set(numbers))
        assert set(numbers) <= set(range(COUNT))
        assert words or len(numbers) == COUNT

    flip()


def record_of(opcode, *parts):
    """Return an MCAP record."""
    content = b''.join(parts)
    return bytes([opcode]) + struct.pack('<Q', len(content)) + content


def text_of(words):
    """Return a text as MCAP records hold it."""
    return struct.pack('<I', len(words)) + words.encode()


HEADER = record_of(1, text_of('ros2'), text_of(''))
#: Of a chunk: times, size and checksum of what it holds.
CHUNK = struct.pack('<QQQI', 0, 0, 2**62, 0)
MADE_UP = {
    'empty': b'',
    'a text': b'rosbag2_bagfile_information:\n  version: 5\n',
    'a length beyond all memory': MAGIC + HEADER + b'\x06' + struct.pack('<Q', 2**62),
    'a chunk beyond all memory': MAGIC
    + HEADER
    + record_of(6, CHUNK, text_of('zstd'), struct.pack('<Q', 4), b'\x28\xb5\x2f\xfd'),
    'an unknown compression': MAGIC
    + HEADER
    + record_of(6, CHUNK, text_of('brotli'), struct.pack('<Q', 1), b'x'),
    'a channel of a schema that there is not': MAGIC
    + HEADER
    + record_of(
        4, struct.pack('<HH', 1, 7), text_of('joint_states'), text_of('cdr'), struct.pack('<I', 0)
    )
    + record_of(5, struct.pack('<HIQQ', 1, 0, 0, 0), b'abc'),
    'a message of a channel that there is not': MAGIC
    + HEADER
    + record_of(5, struct.pack('<HIQQ', 1, 0, 0, 0), b'abc'),
}


def test_a_missing_recording_is_refused(tmp_path, capsys):
    from isotruss_ros.cli import replay

    assert replay.main([str(tmp_path / 'none.mcap'), '--once', '--port', '0']) == 1
    assert 'none.mcap: cannot be read: No such file or directory' in capsys.readouterr().err


@pytest.mark.parametrize('kind', sorted(MADE_UP))
def test_a_file_that_is_no_recording_is_refused(tmp_path, kind):
    numbers, words = read(MADE_UP[kind], tmp_path)
    assert not numbers
    assert (
        'no MCAP file' if kind in {'empty', 'a text'} else 'holds no complete message'
    ) in words


@pytest.mark.parametrize(
    'changes',
    [
        {'text': 'no definition at all ]['},
        {'text': schema_text(JointState).replace('MSG: ', 'MSG: a/b/')},
        {'encoding': 'protobuf'},
        {'name': 'std_msgs/msg/String', 'text': 'string data'},
        {'text': 'string[] name\nfloat64[] other\n'},
    ],
)
def test_messages_that_are_no_joint_states_are_not_shown_as_such(tmp_path, capsys, changes):
    from isotruss_ros.cli import replay

    path = tmp_path / 'other.mcap'
    path.write_bytes(write([pack_joints(0)], **changes))
    replay.main([str(path), '--once', '--port', '0'])
    printed = capsys.readouterr().err
    assert len(printed.splitlines()) == 1
    assert printed.startswith(('replay failed: ', 'replay: '))


@few_examples
@given(st.binary(max_size=100))
def test_a_message_of_random_bytes_raises_package_errors_only(tmp_path_factory, record):
    from isotruss_ros.viewer.recording import read_recording, RecordingError, show_message

    path = tmp_path_factory.getbasetemp() / 'message.mcap'
    path.write_bytes(write([b'\0\1\0\0' + record]))
    with contextlib.suppress(RecordingError, PictureError, ConfigurationError):
        for time, topic, message in read_recording(path):
            show_message(Picture(ROBOT, 0.3), topic, message, time)


def test_replay_shows_the_readable_part_and_reports_the_damage_in_one_line(tmp_path, capsys):
    from isotruss_ros.cli import replay

    path, content = tmp_path / 'half.mcap', whole('ZSTD')
    path.write_bytes(content[: len(content) // 2].ljust(len(content), b'\0'))
    assert replay.main([str(path), '--once', '--port', '0', '--speed', '1000']) == 0
    out, err = capsys.readouterr()
    assert out.startswith('replay: http://127.0.0.1:')
    (line,) = err.splitlines()
    assert line.startswith(f'replay: {path} ends after ')


def test_an_exported_page_names_no_server(tmp_path, capsys):
    from isotruss_ros.cli import replay

    path, page = tmp_path / 'whole.mcap', tmp_path / 'whole.html'
    path.write_bytes(whole('ZSTD'))
    assert replay.main([str(path), '--page', str(page)]) == 0
    assert capsys.readouterr() == (f'written: {page}\n', '')


def test_a_recording_moves_a_picture_as_the_robot_moved(tmp_path):
    from isotruss_ros.viewer.recording import read_recording, show_message

    path, picture = tmp_path / 'joints.mcap', Picture(ROBOT, 0.3)
    path.write_bytes(write([pack_joints(200)]))
    ((time, topic, message),) = read_recording(path)
    show_message(picture, topic, message, time)
    positions = [0.02, -0.01, 0.0, 0.01, 0.0, 0.015]
    assert picture.config.nodes == pytest.approx(ROBOT.configuration(positions).nodes, abs=1e-9)


def grasp_state():
    """Return an instance of the fields of a held grasp that a picture displays."""
    return SimpleNamespace(
        code=0,
        message='',
        held=True,
        force_closure=True,
        hold_message='',
        slip_margin=1.2,
        chance=0.9,
        slip_direction=(1.0, 0.0, 0.0),
        utilisation=(0.1,) * len(ROBOT.member_names),
        squeeze=(5.9, 5.9),
    )


def status():
    """Return an instance of the fields of a status that a picture displays."""
    return SimpleNamespace(code=10, message='', scale=0.5, squeeze=5.9, squeeze_deviation=0.3)


VERSIONED = {'grasp/state': grasp_state, 'manipulation/status': status}


@pytest.mark.parametrize('path', SHIPPED, ids=lambda path: path.name)
def test_every_message_of_a_shipped_recording_is_displayed(path):
    from isotruss_ros.viewer.recording import read_recording, show_message

    picture = Picture(ROBOT, 0.3)
    for time, topic, message in read_recording(path):
        show_message(picture, topic, message, time)
    assert picture.hold(time) is Hold.HELD


@pytest.mark.parametrize('path', SHIPPED, ids=lambda path: path.name)
def test_shipped_recordings_have_the_present_message_definitions(path):
    from mcap.reader import make_reader

    with path.open('rb') as stream:
        recorded = make_reader(stream).get_summary().schemas.values()
    for schema in recorded:
        package, folder, name = schema.name.split('/')
        kind = getattr(importlib.import_module(f'{package}.{folder}'), name)
        assert schema.data.decode() == schema_text(kind), f'{schema.name}: make pictures'


def test_recordings_are_shipped():
    assert SHIPPED


@pytest.mark.parametrize(
    ('topic', 'name'),
    [
        (topic, name)
        for topic, make in VERSIONED.items()
        for name in vars(make())
        if name != 'code'
    ],
)
def test_a_field_that_a_recording_lacks_is_unknown(topic, name):
    from isotruss_ros.viewer.panels import describe
    from isotruss_ros.viewer.recording import show_message

    picture, message = Picture(ROBOT, 0.3), VERSIONED[topic]()
    delattr(message, name)
    message.added_later = 1.0
    assert show_message(picture, topic, message, 0.0) == (name,)
    picture.sample(0.0)
    assert describe(picture, 0.0)
    assert picture.describe_hindrance(0.0, 1.0)
    unknown = name == 'held' or topic != 'grasp/state'
    assert picture.hold(0.0) is (Hold.UNKNOWN if unknown else Hold.HELD)


def test_a_missing_field_is_reported_once_by_name(tmp_path, capsys):
    from isotruss_ros.cli import replay

    path = tmp_path / 'older.mcap'
    kind, text = (
        'isotruss_msgs/msg/ManipulationStatus',
        'uint8 code\nstring message\nfloat64 scale',
    )
    record = bytes([0, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0]).ljust(20, b'\0') + bytes(8)
    path.write_bytes(write([record] * 3, text=text + '\n', name=kind, topic='manipulation/status'))
    assert replay.main([str(path), '--page', str(tmp_path / 'older.html')]) == 0
    assert capsys.readouterr().err.splitlines() == [
        f'replay: /arm/manipulation/status: no field {name} in this version: unknown'
        for name in ('squeeze', 'squeeze_deviation')
    ]


def test_an_error_of_the_reader_of_messages_is_no_damage(tmp_path):
    from isotruss_ros.viewer.recording import read_recording

    path = tmp_path / 'whole.mcap'
    path.write_bytes(whole('ZSTD'))
    messages = read_recording(path)
    next(messages)
    with pytest.raises(ZeroDivisionError):
        messages.throw(ZeroDivisionError())
