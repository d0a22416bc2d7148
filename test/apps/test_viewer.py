# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The live view without a browser: meshes, drags, recordings."""

import contextlib
import importlib.util
import math

from builtin_interfaces.msg import Time
from isotruss_msgs.msg import GraspState, ManipulationStatus
from isotruss_ros.core import load_robot, Polygon
from isotruss_ros.nodes.conversions.message_text import schema_text, type_name
from isotruss_ros.viewer.control import Control, ZERO
from isotruss_ros.viewer.drag import (
    Drag,
    LEVER,
    PATIENCE,
    place_on_circle,
    PROGRESS,
    REACHED,
)
from isotruss_ros.viewer.meshes import color_of, CORNERS, prism, tube_faces, tube_vertices
from isotruss_ros.viewer.picture import Picture, TIMEOUT, trim_start
import numpy as np
import pytest
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker, MarkerArray

ROBOT = load_robot('nine_member')
#: With which MCAP files begin and end.
MAGIC = b'\x89MCAP0\r\n'
RECORDS = all(map(importlib.util.find_spec, ('mcap', 'rosbags')))


def test_a_tube_is_closed_around_its_line_and_as_wide_as_its_diameter():
    line = np.array([0.0, 0.5 + 0.0j, 1.0])
    vertices = tube_vertices(line, 0.1, 28).reshape(28, CORNERS, 3)
    radius = np.linalg.norm(vertices[:, :, 1:], axis=2)
    assert radius[14] == pytest.approx(0.05)
    assert radius[0] == pytest.approx(0.15 * 0.05)
    assert radius.max() <= 0.05 + 1e-12
    assert vertices[:, 0, 0] == pytest.approx(np.sort(vertices[:, 0, 0]))
    edges = np.sort(tube_faces(28)[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    # Two triangles at every edge but those of the two open ends.
    assert (count == 1).sum() == 2 * CORNERS
    assert set(count) == {1, 2}


def test_a_prism_is_closed_and_shows_its_faces_outward():
    outline = Polygon([(-0.2, -0.1), (0.3, -0.1), (0.3, 0.1), (-0.2, 0.1)], 0.05).outline(0.01)
    vertices, faces = prism(outline, 0.2)
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert set(count) == {2}
    a, b, c = vertices[faces].transpose(1, 0, 2)
    # Six times the volume, by the divergence theorem.
    volume = (a * np.cross(b, c)).sum() / 6.0
    assert volume == pytest.approx(0.2 * (0.5 * 0.2 - (4.0 - np.pi) * 0.05**2), rel=1e-2)


def test_a_wrinkling_tube_is_red_and_an_unloaded_one_is_not():
    red, green, blue = color_of(1.2)
    assert red > 200 > 60 > max(green, blue)
    assert color_of(0.0)[2] > color_of(0.0)[0]


def test_a_drag_goes_straight_to_its_target_and_not_faster_than_allowed():
    x, y = 0.0, 0.0
    drag = Drag((0.3, 0.4), 0.0)
    for _ in range(2000):
        vx, vy = drag.follow((x, y), 0.05, 0.0)
        assert math.hypot(vx, vy) <= 0.05 + 1e-12
        assert 0.4 * vx == pytest.approx(0.3 * vy)
        x, y = x + 0.01 * vx, y + 0.01 * vy
    assert math.dist((x, y), (0.3, 0.4)) <= REACHED
    assert (vx, vy) == (0.0, 0.0)


def drag_along(drag, share, speed=0.05, duration=10.0, step=0.05):
    """Return the time at which a drag is stuck, where that share of each twist is carried out."""
    x, y, now = 0.0, 0.0, 0.0
    while now < duration and not drag.is_stuck(now):
        vx, vy = drag.follow((x, y), speed, now)
        x, y, now = x + share * step * vx, y + share * step * vy, now + step
    return now


def test_a_drag_that_creeps_is_stuck_after_its_patience():
    assert drag_along(Drag((3.0, 4.0), 0.0), 0.5 * PROGRESS) == pytest.approx(PATIENCE, abs=0.06)


@pytest.mark.parametrize('target', [(3.0, 4.0), (0.02, 0.0)])
def test_a_slow_drag_goes_on_and_stays_where_it_arrived(target):
    assert drag_along(Drag(target, 0.0), 2.0 * PROGRESS) == pytest.approx(10.0, abs=0.06)


def test_a_drag_whose_target_runs_away_is_not_stuck():
    drag, x = Drag((0.1, 0.0), 0.0), 0.0
    for step in range(200):
        drag.target = (0.1 + 0.02 * step, 0.0)
        x += 0.05 * drag.follow((x, 0.0), 0.05, 0.05 * step)[0]
        assert not drag.is_stuck(0.05 * step)


def test_a_drag_of_what_is_not_seen_is_stuck_after_its_patience():
    drag = Drag((1.0, 0.0), 5.0)
    assert not drag.is_stuck(5.0 + 0.9 * PATIENCE)
    assert drag.is_stuck(5.0 + PATIENCE)


@pytest.mark.parametrize(('begin', 'end'), [(0.0, 2.5), (3.0, -3.0), (-3.1, 3.1), (1.0, -1.0)])
def test_a_turn_goes_the_shorter_way_and_not_faster_than_allowed(begin, end):
    angle, drag = begin, Drag(place_on_circle(end, place_on_circle(begin)[0]), 0.0)
    for step in range(2000):
        position = place_on_circle(angle, drag.target[0])
        way, across = drag.follow(position, 0.05, 0.05 * step)
        assert abs(way) <= 0.05 + 1e-12
        assert across == 0.0
        angle += 0.05 * way / LEVER
    assert math.remainder(angle - end, 2.0 * math.pi) == pytest.approx(0.0, abs=REACHED / LEVER)
    assert abs(angle - begin) <= math.pi


def test_a_turn_goes_on_beyond_a_whole_one():
    way = 0.0
    for angle in np.linspace(0.0, 10.0, 50):
        way, _ = place_on_circle(angle, way)
    assert way == pytest.approx(10.0 * LEVER)


def test_the_handle_that_was_not_grabbed_does_not_move_the_target():
    control = Control(1)
    control.drag_to((0.5, 0.0), True, 0.0, turns=True)
    control.drag_to((2.0, 2.0), False, 0.1)
    assert (control.drag.target, control.drag.turns) == ((0.5, 0.0), True)


def test_one_browser_has_control_and_the_others_see_which():
    control = Control()
    control.pass_on({1: False, 2: True})
    control.pass_on({1: True, 2: True})
    assert control.browser == 2
    assert control.describe(1) == 'browser 1: browser 2 has control'


@pytest.mark.parametrize('wishes', [{}, {2: False}, {1: False, 3: False}, {3: True}])
def test_what_a_browser_commands_ends_with_its_control(wishes):
    control = Control(2, Drag((1.0, 0.0), 0.0), (5.0, 0.0, 0.0))
    control.pass_on(wishes)
    assert control == Control(3 if wishes.get(3) else None, None, ZERO)


def test_a_drag_that_was_given_up_comes_back_only_with_a_new_one():
    control = Control(2)
    control.drag_to((1.0, 0.0), False, 0.0)
    assert control.drag is None
    control.drag_to((1.0, 0.0), True, 0.0)
    control.drag_to((2.0, 0.0), False, 1.0)
    assert control.drag.target == (2.0, 0.0)


def test_what_is_old_is_not_shown_as_held():
    picture = Picture(ROBOT, 0.3)
    assert picture.is_held(0.0) is None
    picture.receive_state(GraspState(code=0, held=True), 1.0)
    assert picture.is_held(1.0) is True
    assert picture.is_held(1.0 + TIMEOUT) is None
    picture.receive_state(GraspState(code=21, held=False), 2.0)
    assert picture.is_held(2.0) is None


def test_joint_states_move_the_picture_as_they_move_the_robot():
    picture = Picture(ROBOT, 0.3)
    positions = [0.02, -0.01, 0.0, 0.01, 0.0, 0.015]
    picture.receive_joint_states(
        JointState(name=list(ROBOT.roller_names), position=positions), 0.0
    )
    assert picture.config.nodes == pytest.approx(ROBOT.configuration(positions).nodes, abs=1e-9)


def test_what_the_analysis_deletes_is_drawn_no_more():
    picture, shown = Picture(ROBOT, 0.3), [Marker(ns='deformed', id=i) for i in range(2)]
    picture.receive_markers(MarkerArray(markers=shown), 0.0)
    deletions = (
        Marker(ns='deformed', id=1, action=Marker.DELETE),
        Marker(action=Marker.DELETEALL),
    )
    for left, deletion in zip((1, 0), deletions, strict=True):
        picture.receive_markers(MarkerArray(markers=[deletion]), 0.0)
        assert len(picture.select_lines('deformed', 0.0)) == left


@pytest.mark.skipif(not RECORDS, reason='needs mcap and rosbags')
def test_a_recording_is_read_without_ros(tmp_path):
    from isotruss_ros.viewer.recording import read_recording, show_message
    from mcap.writer import Writer
    from rosbags.typesys import get_types_from_msg, get_typestore, Stores

    for kind in (JointState, GraspState, ManipulationStatus, MarkerArray):
        first = schema_text(kind).split('=' * 80)[0]
        name = type_name(kind)
        fields = get_types_from_msg(first, name)[name][1]
        assert [field for field, _ in fields] == list(kind.get_fields_and_field_types())
    types = get_typestore(Stores.ROS2_JAZZY).types
    header = types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](1, 2), 'truss')
    positions = np.array([0.02, -0.01, 0.0, 0.01, 0.0, 0.015])
    nothing = np.zeros(0)
    joints = types['sensor_msgs/msg/JointState'](
        header, list(ROBOT.roller_names), positions, nothing, nothing
    )
    packed = get_typestore(Stores.ROS2_JAZZY).serialize_cdr(joints, 'sensor_msgs/msg/JointState')
    path = tmp_path / 'joints.mcap'
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start('ros2')
        schema = writer.register_schema(
            type_name(JointState), 'ros2msg', schema_text(JointState).encode()
        )
        channel = writer.register_channel('/joint_states', 'cdr', schema)
        writer.add_message(channel, 5_000_000_000, bytes(packed), 5_000_000_000)
        writer.finish()
    ((time, topic, message),) = read_recording(path)
    assert (time, topic) == (5.0, '/joint_states')
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1, 2)
    assert Time.get_fields_and_field_types().keys() == {'sec', 'nanosec'}
    picture = Picture(ROBOT, 0.3)
    show_message(picture, topic, message, time)
    assert picture.config.nodes == pytest.approx(ROBOT.configuration(positions).nodes, abs=1e-9)


@pytest.mark.skipif(not RECORDS, reason='needs mcap and rosbags')
def test_what_is_complete_of_a_recording_that_breaks_off_is_read(tmp_path):
    """Wherever its writer was killed: all messages up to there, or one sentence that says none."""
    from isotruss_ros.viewer.recording import read_recording, RecordingError
    from mcap.writer import Writer

    path = tmp_path / 'whole.mcap'
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start('ros2')
        schema = writer.register_schema('std_msgs/msg/Byte', 'ros2msg', b'byte data')
        channel = writer.register_channel('/bytes', 'cdr', schema)
        ends = []
        for k in range(5):
            writer.add_message(channel, 10**9 * k, bytes([0, 1, 0, 0, k]), 0)
            writer.flush()
            ends.append(stream.tell())
        writer.finish()
    whole = path.read_bytes()
    near = {end + step for end in ends for step in (-1, 0, 1)}
    for size in sorted({*range(0, len(whole), 7), *near, len(whole)}):
        path.write_bytes(whole[:size])
        complete = sum(end <= size for end in ends)
        times = []
        with contextlib.nullcontext() if complete else contextlib.suppress(RecordingError):
            times += (time for time, _, _ in read_recording(path))
        # The index of a chunk follows it.
        assert times in (list(range(complete)), list(range(complete + 1))), size


@pytest.mark.skipif(
    not (RECORDS and importlib.util.find_spec('viser')), reason='needs viser, mcap and rosbags'
)
def test_replay_says_once_that_a_recording_breaks_off_or_holds_nothing(tmp_path, capsys):
    from isotruss_ros.cli import replay

    path = tmp_path / 'short.mcap'
    path.write_bytes(MAGIC)
    assert replay.main([str(path), '--once', '--port', '0']) == 1
    assert capsys.readouterr().err.splitlines() == [
        f'replay: {path} breaks off: what is complete is shown',
        f'replay failed: {path}: holds no complete message',
    ]


@pytest.mark.skipif(not RECORDS, reason='needs mcap and rosbags')
@pytest.mark.parametrize('content', [b'', MAGIC[:3], MAGIC, 2 * MAGIC[:4], MAGIC + b'\1'])
def test_a_recording_without_a_message_is_refused(tmp_path, content):
    from isotruss_ros.viewer.recording import read_recording, RecordingError

    path = tmp_path / 'short.mcap'
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r'short\.mcap: '):
        list(read_recording(path))


def test_a_curve_begins_where_it_is_known():
    time, values = np.arange(4.0), np.array([np.nan, 1.0, np.nan, 2.0])
    shown = trim_start(time, values)
    assert shown[0].tolist() == [1.0, 2.0, 3.0]
    assert np.array_equal(shown[1], values[1:], equal_nan=True)
    assert all(len(part) == 2 for part in trim_start(time, np.full(4, np.nan)))
