# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command 'isotruss compare', and the option '--decide' of 'isotruss replay'."""

from functools import partial
import json
from pathlib import Path
import re

from held_grips import HOME
from isotruss_ros.core import (
    ConvexObject,
    Disc,
    Grip,
    load_robot,
    Pose,
    Status,
    tangent_center,
)
from isotruss_ros.core.inputs import LatestInputs, RollerState, StampedInput
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.recording.recorded_servo import RecordedServo
from isotruss_ros.core.servo.decision import Decision
from isotruss_ros.core.servo.servo_settings import ServoSettings
import numpy as np
import pytest

for package in ('mcap', 'rosbags', 'viser'):
    pytest.importorskip(package)
from isotruss_ros.cli import compare, replay  # noqa: E402,I100
from isotruss_ros.cli.decide_again import has_news  # noqa: E402
from isotruss_ros.identification import read_run  # noqa: E402
from isotruss_ros.viewer import view  # noqa: E402
from mcap.writer import Writer  # noqa: E402
from robots import preset_document  # noqa: E402
from rosbags.typesys import get_typestore, Stores  # noqa: E402

KIND, MODULE = 'std_msgs/msg/String', 'north/Z'
CARRY = Path(__file__).parents[3] / 'docs' / 'images' / 'carry.mcap'


def test_a_carry_in_mujoco_agrees_with_the_model_and_is_drawn(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(read_run, 'read_run', partial(read_run.read_run, count=12))
    picture = tmp_path / 'carry.png'
    assert compare.main([str(CARRY), '--picture', str(picture)]) == 0
    out = capsys.readouterr().out
    assert 'held until the end' in out
    assert 'named: none' in out
    assert 'core.Uncertainty(' in out
    assert picture.read_bytes().startswith(b'\x89PNG')


def test_a_gauge_on_another_clock_is_refused(tmp_path, capsys):
    forces = tmp_path / 'gauge.csv'
    forces.write_text('time_s,squeeze_N\n-20,9\n-10,9\n', encoding='utf-8')
    assert compare.main([str(CARRY), '--forces', str(forces)]) == 1
    assert '--gauge-zero' in capsys.readouterr().err


def test_a_file_that_is_no_recording_is_refused(tmp_path, capsys):
    path = tmp_path / 'run.mcap'
    path.write_bytes(b'text')
    assert compare.main([str(path)]) == 1
    assert capsys.readouterr().err.startswith(f'compare: {path}: no MCAP file')


def record(home=HOME, diameter=0.3):
    """Return the records of a motion that ends because the pose is missing."""
    body = ConvexObject(Disc(diameter)).moved_to((*tangent_center(home, MODULE, diameter), 0.0))
    grip, texts = Grip(members_at(home.robot, MODULE), body), []
    servo = RecordedServo(home.robot, ServoSettings(grip, 0.01, 0.05), LatestInputs())
    zeros = np.zeros(6)
    for now in 0.01 * np.arange(20):
        servo.receive(
            twist=StampedInput(np.array([0.0, 0.02, 0.0]), now),
            rollers=StampedInput(RollerState(zeros, zeros, zeros), now),
        )
        if now < 0.1:
            servo.receive(pose=StampedInput(Pose(*body.pose), now))
        servo.decide(float(now))
        texts.append(servo.describe())
    return texts


TEXTS = record()


def write(path, texts):
    store = get_typestore(Stores.ROS2_JAZZY)
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start('ros2')
        schema = writer.register_schema(KIND, 'ros2msg', b'string data\n')
        channel = writer.register_channel('/manipulation/cycle', 'cdr', schema)
        for number, text in enumerate(texts):
            data = bytes(store.serialize_cdr(store.types[KIND](text), KIND))
            writer.add_message(channel, 10**7 * number, data, 0)
        writer.finish()
    return str(path)


@pytest.fixture
def decide(tmp_path, capsys):
    """Return a function that decides recorded cycles again; it returns code, output and errors."""

    def run(texts, *options):
        path = write(tmp_path / 'run.mcap', texts)
        return replay.main([path, '--decide', *options]), *capsys.readouterr()

    return run


class View:
    """A view without a server."""

    address, drawn = '', []

    def __init__(self, picture, *_):
        self.picture = picture
        self.drawn.append(picture)

    def update(self, now):
        pass

    def close(self):
        pass


@pytest.fixture
def own_robot(tmp_path):
    """Return the path of a robot with the members of nine_member, 1.25 times as long."""
    content = preset_document('nine_member')
    content['joints'] = {name: [1.25 * x, 1.25 * y] for name, (x, y) in content['joints'].items()}
    path = tmp_path / 'mine.yaml'
    path.write_text(json.dumps(content | {'name': 'mine'}), 'utf-8')
    return path


@pytest.mark.parametrize('options', [(), ('--robot', 'nine_member', '--diameter', '0.1')])
def test_replay_draws_robot_and_object_of_the_recording(
    options, own_robot, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(view, 'View', View)
    robot = load_robot(own_robot)
    path = write(tmp_path / 'run.mcap', record(robot.home, 0.36))
    assert replay.main([path, '--once', '--speed', '1000', *options]) == 0
    picture = View.drawn.pop()
    assert picture.robot.home.points == pytest.approx(robot.home.points)
    assert (picture.diameter, picture.shape) == (0.36, Disc(0.36))
    told = '--robot nine_member: not the robot of the recording'
    assert (told in capsys.readouterr().err) == bool(options)


def test_a_recorded_run_has_the_same_commands_and_the_reason_of_its_halt(decide):
    code, out, _ = decide(TEXTS)
    assert code == 0
    assert f'{Status.HALT_STALE_OBJECT_POSE.name}: object pose: ' in out
    assert '20 cycles of 0.2 s' in out
    assert '0 commands differ; largest difference 0 ' in out


def test_cycles_that_are_recorded_twice_are_decided_once(decide):
    code, out, _ = decide([text for text in TEXTS for _ in range(2)])
    assert code == 0
    assert '20 cycles of 0.2 s' in out
    assert 'new memory' not in out


WHY = 'trajectory aborted: t/a is 9 mm off'


def record_trajectory():
    """Return the records of roller commands that end because their client aborts them."""
    grip = Grip(members_at(HOME.robot, MODULE), ConvexObject(Disc(0.3)))
    servo, texts = RecordedServo(HOME.robot, ServoSettings(grip, 0.01, 0.05), LatestInputs()), []
    for number in range(10):
        now = 0.01 * number
        if number < 5:
            servo.command(np.full(6, 0.01 if number < 4 else 0.0), now)
            decision = None
        else:
            decision = servo.decide(now)
        if number >= 4:
            command = RollerCommand(np.zeros(6), np.zeros(3), 1.0, Status.HALT_TRAJECTORY)
            decision = Decision(command, np.zeros(3), WHY)
        texts.append(servo.describe(reported=decision))
    return texts


def test_the_reason_of_an_aborted_trajectory_is_that_of_the_recording(decide):
    code, out, _ = decide(record_trajectory())
    assert code == 0
    assert f'cycle 4, 0.040 s: HALT_TRAJECTORY: {WHY}' in out
    assert 'HALT_TRAJECTORY: 6 cycles' in out


def test_a_failed_roller_is_named_with_its_cycle(decide):
    late = json.loads(TEXTS[7])
    late['inputs']['mapping']['failed'] = ['south/P']
    _, out, _ = decide([*TEXTS[:7], json.dumps(late), *TEXTS[8:]])
    assert 'cycle 7, 0.070 s: failed rollers: south/P' in out


def test_another_setting_is_named_with_the_first_other_command(decide):
    code, out, _ = decide(TEXTS, '--set', 'timeout=1.0')
    assert code == 3
    assert 'another setting: timeout: 0.05 -> 1.0' in out
    assert 'first other command' in out


def test_a_setting_of_a_part_that_is_off_changes_nothing(decide):
    code, out, _ = decide(TEXTS, '--set', 'squeeze.force=40')
    assert code == 0
    assert 'another setting' not in out


def test_recorded_velocities_that_are_no_numbers_are_refused(decide):
    record = json.loads(TEXTS[5])
    record['decision']['mapping']['velocities']['array'][0] = float('nan')
    code, _, err = decide([*TEXTS[:5], json.dumps(record), *TEXTS[6:]])
    assert code == 1
    assert 'cycle 5: recorded velocities' in err


def test_another_version_is_named(decide):
    code, out, _ = decide([text.replace('"numpy": "', '"numpy": "0.') for text in TEXTS])
    assert code == 0
    assert f'another version: numpy 0.{np.__version__} -> {np.__version__}' in out


def test_a_recording_with_a_broken_field_is_refused(decide):
    code, _, err = decide([*TEXTS[:3], json.dumps(json.loads(TEXTS[3]) | {'now': 'noon'})])
    assert code == 1
    assert 'now: ' in err


WRONG_SETTINGS = {
    **dict.fromkeys(('nothing', 'grip.none=1', 'grip.body.arm=1', 'period=-1', 'period=[1]'), ''),
    'squeeze.forc=1': '--set squeeze.forc: no such setting; did you mean squeeze.force?',
    'time_out=1': '--set time_out: no such setting; did you mean timeout? must be of grip.',
}


@pytest.mark.parametrize('change', WRONG_SETTINGS)
def test_a_setting_that_does_not_exist_or_is_out_of_range_is_refused(change, decide):
    code, _, err = decide(TEXTS, '--set', change)
    assert code == 1
    assert err.startswith(f'replay failed: {WRONG_SETTINGS[change]}')


def test_options_of_the_view_are_refused_with_decide(decide, capsys):
    with pytest.raises(SystemExit, match='2'):
        decide(TEXTS, '--once')
    assert '--once with --decide' in capsys.readouterr().err


def test_a_recording_without_cycles_decides_from_its_statuses_and_names_what_is_absent(capsys):
    assert replay.main([str(CARRY), '--decide']) == 0
    out = capsys.readouterr().out
    assert out.startswith('absent in this recording: settings, ')
    # One cycle each 0.2 s; the recording is drawn anew when messages change.
    assert re.search(r'\n10\d cycles of 20\.\d s decided', out)
    assert '0 commands differ' in out


def test_a_slowing_that_alternates_with_execution_is_printed_once():
    slowed, halted = Status.SLOWED_BARRIER, Status.HALT_NOT_HELD
    assert [has_news(slowed, now) for now in (None, slowed, halted)] == [False, False, True]
    assert has_news(halted, None)
