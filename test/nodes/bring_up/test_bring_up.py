# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks before a robot moves: its rollers, and the inputs of `preflight`."""

from pathlib import Path
import re

from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.core import load_robot
from isotruss_ros.nodes.bring_up.check_rollers import CheckRollers
from isotruss_ros.nodes.bring_up.preflight import Preflight
from isotruss_ros.nodes.framework.commands import TOPIC
from isotruss_ros.nodes.simulator.node import Simulator
from manual_world import world
from mujoco_worlds import needs_mujoco
from probe import hang_joints, maker, overrides, ROBOT
import pytest
from std_msgs.msg import Bool, Float64MultiArray

MARKERS = {'tracker_rate': 20.0, 'tracker_noise': 0.001, 'marker_joints': ['all']}
plant = maker(Simulator, object_is_free=True, object_pose=[0.6, 5.0, 0.0], **MARKERS)
checking = maker(CheckRollers, settle_time=0.5, speed=0.04)
LINES = ['encoders', 'roller offsets', 'object pose', 'emergency stop', 'limits', 'rates']
LINES += ['roller signs', 'masses']


def refused(words):
    return pytest.raises(MeasurementError, match=words)


@pytest.mark.parametrize(
    'kind', ['kinematic', pytest.param('mujoco', marks=[needs_mujoco, pytest.mark.nightly])]
)
def test_a_faultless_robot_passes_the_check(kind, tmp_path):
    output = tmp_path / 'mine.yaml'
    with world(plant(plant=kind, rate=50.0), checking(output=str(output))) as w:
        w.spin(13.0)
        w.until(lambda: w.nodes[2].done)
        assert w.nodes[2].faultless == list(ROBOT.roller_names)
        assert abs(w.travel()).max() < 2e-3
    calibration = load_robot(output).description.calibration
    assert calibration['checked_rollers'] == list(ROBOT.roller_names)


def test_a_roller_that_does_not_turn_is_named_before_another_one_does():
    with world(plant(stuck_roller='south/Q'), checking()) as w, refused('roller south/Q: no meas'):
        w.spin(15.0)


def test_a_roller_of_the_wrong_sign_is_named():
    remaps = {('simulator', f'/{TOPIC}'): '/negated'}
    with world(plant(), checking(), remaps=remaps) as w:
        drives = w.probe.create_publisher(Float64MultiArray, 'negated', 1)

        def negate(command):
            drives.publish(Float64MultiArray(data=[-speed for speed in command.data]))

        w.probe.create_subscription(Float64MultiArray, TOPIC, negate, 10)
        with refused('south/P: it turned the other way, by -'):
            w.spin(15.0)


@pytest.mark.parametrize(
    ('send', 'words'),
    [
        (lambda w: w.probe.send_command([0.01] * 6), 'another node publishes on'),
        (lambda w: w.probe.stops.publish(Bool(data=True)), 'emergency_stop is true'),
    ],
    ids=['another node', 'emergency stop'],
)
def test_a_command_of_another_node_or_an_emergency_stop_ends_the_check(send, words):
    with world(plant(), checking()) as w:
        w.spin(3.0)
        send(w)
        with refused(words):
            w.spin(1.0)


def write_checked(tmp_path):
    """Write a robot file as the tools of bring-up leave it."""
    path = tmp_path / 'checked.yaml'
    text = Path(ROBOT.description.source).read_text(encoding='utf-8')
    offsets = ', '.join(f'{name}: 0.001' for name in ROBOT.roller_names)
    rollers = ', '.join(ROBOT.roller_names)
    path.write_text(
        f'{text}\ncalibration: {{zero_deviations: {{{offsets}}}, checked_rollers: [{rollers}]}}\n'
    )
    return str(path)


def fly(path, capsys, *, stops=(True, False), speed=0.0, joints=None, checks=None, **values):
    """Run the checks with a plant; return the faults and what was printed."""
    checked = {'robot': path, 'object_mass': 0.5} | (checks or {})
    with world(plant(**values), lambda: Preflight(overrides(**checked))) as w:
        for stop in stops:
            w.probe.stops.publish(Bool(data=stop))
        if speed:
            w.spin(0.5, lambda: w.probe.send_command([speed, *5 * [0.0]]))
        node = w.nodes[2]
        try:
            w.until(lambda: node.done, lambda: joints and w.probe.send_markers(joints))
        except MeasurementError:
            assert node.faults
    return node.faults, capsys.readouterr().out


def test_a_robot_that_is_ready_passes(tmp_path, capsys):
    body = '{shape: disc, diameter: 0.3, mass: 0.4}'
    checks = {'object_mass': 0.0, 'object': body}
    faults, printed = fly(write_checked(tmp_path), capsys, checks=checks)
    assert faults == []
    assert 'object 0.4 kg' in printed
    lines = [line.split(':')[0] for line in printed.splitlines()]
    assert lines == [f'ok    {name}' for name in LINES]
    assert 'ok    roller offsets: standard deviation up to 1.0 mm; marker' in printed


def test_a_robot_of_a_preset_is_not_ready(tmp_path, capsys):
    faults, printed = fly('nine_member', capsys, stops=(), checks={'object_mass': 0.0})
    assert faults == ['roller offsets', 'emergency stop', 'roller signs', 'masses']
    assert 'run calibrate_home' in printed
    assert 'masses: object_mass is missing' in printed


HANGING = {'marker_joints': [''], 'joints': hang_joints(9.8)}
LENGTHS = ROBOT.home.member_lengths
NARROWED = (
    'min_length: 0.25, max_length: 2.0',
    f'min_length: {LENGTHS.min() - 0.01}, max_length: {LENGTHS.max() + 0.01}',
)


@pytest.mark.parametrize(
    ('name', 'plant_values', 'edit', 'words'),
    [
        ('encoders', {'encoder_delay': 0.8}, (), r'joint states: 0\.8\d* s old'),
        (
            'roller offsets',
            {'zero_deviation': 0.03, 'seed': 2},
            (),
            'encoders; must be at most 10 mm',
        ),
        ('roller offsets', HANGING, (), 'the robot stands upright'),
        ('rates', {'tracker_rate': 8.0}, (), r'object_pose has [\d.]+ Hz'),
        ('emergency stop', {'stops': (False, True)}, (), 'the last message .* is true'),
        ('roller signs', {}, (', north/Z]}', ']}'), 'north/Z were not checked'),
        ('limits', {'speed': 0.05}, NARROWED, r'member \S+ is [\d.]+ m long: must be'),
    ],
)
def test_only_the_faulty_check_is_named(tmp_path, capsys, name, plant_values, edit, words):
    robot = Path(write_checked(tmp_path))
    text = robot.read_text()
    assert not edit or edit[0] in text
    robot.write_text(text.replace(*edit) if edit else text)
    faults, printed = fly(str(robot), capsys, **plant_values)
    assert faults == [name]
    assert re.search(f'FAULT {name}: .*{words}', printed)
