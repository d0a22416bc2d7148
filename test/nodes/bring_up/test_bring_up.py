# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks before a robot moves, and measurements of offsets, stiffness and frequency."""

import math
from pathlib import Path
import re

from geometry_msgs.msg import Twist, Vector3
from isotruss_msgs.msg import ManipulationStatus
from isotruss_msgs.srv import CalibrateStiffness
from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.core import load_robot
from isotruss_ros.nodes.bring_up.calibration import Calibration
from isotruss_ros.nodes.bring_up.check_rollers import CheckRollers
from isotruss_ros.nodes.bring_up.pluck import Pluck, PUSH_TIME
from isotruss_ros.nodes.bring_up.preflight import Preflight
from isotruss_ros.nodes.framework.commands import TOPIC
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.simulator.node import Simulator
from manual_world import world
from mujoco_worlds import needs_mujoco
import numpy as np
from probe import hang_joints, maker, overrides, ROBOT
import pytest
from std_msgs.msg import Bool, Float64MultiArray
from std_srvs.srv import Trigger

MARKERS = {'tracker_rate': 20.0, 'tracker_noise': 0.001, 'marker_joints': ['all']}
KINDS = ['kinematic', pytest.param('mujoco', marks=[needs_mujoco, pytest.mark.nightly])]
plant = maker(Simulator, object_is_free=True, object_pose=[0.6, 5.0, 0.0], rate=50.0, **MARKERS)
checking = maker(CheckRollers, settle_time=0.5, speed=0.04, rate=50.0)
LINES = ['encoders', 'roller offsets', 'object pose', 'emergency stop', 'limits', 'rates']
LINES += ['roller signs', 'masses']


def refused(words):
    return pytest.raises(MeasurementError, match=words)


@pytest.mark.parametrize('kind', KINDS)
def test_a_faultless_robot_passes_the_check(kind, tmp_path):
    output = tmp_path / 'mine.yaml'
    with world(plant(plant=kind), checking(output=str(output))) as w:
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
    with world(plant(rate=100.0, **values), lambda: Preflight(overrides(**checked))) as w:
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


NAMES = ROBOT.topology.joint_names
TRACKER = {'tracker_rate': 20.0, 'tracker_noise': 0.001, 'tracker_dropouts': 0.3, 'seed': 4}
#: The encoders read zero 15 mm from the home.
unmeasured = maker(
    Simulator,
    object_is_free=True,
    object_pose=[0.6, 5.0, 0.0],
    zero_deviation=0.015,
    marker_joints=['all'],
    rate=50.0,
    **TRACKER,
)


def calibrating(tmp_path):
    return lambda: Calibration(overrides(output=str(tmp_path / 'mine.yaml')))


@pytest.mark.parametrize('kind', KINDS)
def test_written_home_agrees_with_the_simulated_robot(tmp_path, kind):
    with world(unmeasured(plant=kind), calibrating(tmp_path)) as w:
        w.spin(1.5)
        answer = w.call('calibrate_home', Trigger.Request())
        truth = w.nodes[1].robot.home
    assert answer.success, answer.message
    assert 'roller offsets [mm]: south/P' in answer.message
    result = load_robot(tmp_path / 'mine.yaml').home
    off = (result.nodes - truth.nodes)[: len(NAMES)]
    assert np.hypot.reduce(off, axis=1).max() < 1.5e-3
    assert np.abs((truth.nodes - ROBOT.home.nodes)[: len(NAMES)]).max() > 0.015


@needs_mujoco
def test_a_plant_as_stiff_as_the_model_has_a_stiffness_scale_of_one(tmp_path):
    with world(unmeasured(plant='mujoco'), calibrating(tmp_path)) as w:
        w.spin(1.5)
        assert w.call('calibrate_home', Trigger.Request()).success
        w.nodes[1]._plant.plant.load_joint('Z', (10.0, 0.0))
        w.spin(2.5)
        request = CalibrateStiffness.Request(joint='Z', force=Vector3(x=10.0))
        answer = w.call('calibrate_stiffness', request)
    assert answer.success, answer.message
    assert answer.scale == pytest.approx(1.0, rel=0.07)
    assert abs(answer.scale - 1.0) < 3.0 * answer.deviation < 0.3
    description = load_robot(tmp_path / 'mine.yaml').description
    assert description.stiffness_scale == pytest.approx(answer.scale, rel=1e-3)


def test_a_force_in_another_posture_is_refused(tmp_path):
    with world(unmeasured(), calibrating(tmp_path)) as w:
        w.spin(1.5)
        answer = w.call('calibrate_stiffness', CalibrateStiffness.Request(joint='Z'))
    assert not answer.success
    assert answer.message.endswith('first call calibrate_home')


def test_missing_markers_are_reported(tmp_path):
    with world(unmeasured(marker_joints=['']), calibrating(tmp_path)) as w:
        w.spin(1.5)
        answer = w.call('calibrate_home', Trigger.Request())
    assert not answer.success
    assert answer.message == 'joint markers: none received yet'
    assert not (tmp_path / 'mine.yaml').exists()


HELD = {'object_diameter': 0.2, 'friction': 0.8}
manipulation = maker(Manipulation, **HELD)
pluck = maker(Pluck, object_diameter=0.2)
held = maker(Simulator, indentation=0.01, **HELD)


def test_frequency_and_damping_ratio_are_fitted_to_the_poses_after_the_push():
    frequency, ratio, begun = 12.0, 0.1, []
    with world(pluck()) as w:
        w.probe.listen(Twist, 'twist', 'cmd_vel')
        statuses = w.probe.create_publisher(ManipulationStatus, 'manipulation/status', 1)

        def send():
            statuses.publish(ManipulationStatus())
            if not begun and w.probe.last('twist') not in (None, Twist()):
                begun.append(w.now)
            time = w.now - begun[0] - PUSH_TIME if begun else -1.0
            angle = frequency * math.sqrt(1.0 - ratio**2) * time
            swing = 2e-3 * math.exp(-ratio * frequency * time) * math.cos(angle)
            w.probe.send_object((swing if time > 0.0 else 0.05, 0.3, 0.0))

        w.until(lambda: w.nodes[1].done, send)
        result = w.nodes[1].oscillation
    assert result.frequency == pytest.approx(frequency, rel=0.01)
    assert result.damping_ratio == pytest.approx(ratio, rel=0.05)


def test_active_squeeze_control_is_refused():
    with (
        pytest.raises(MeasurementError, match='squeeze_force of manipulation: must be 0'),
        world(held(), manipulation(squeeze_force=20.0, object_mass=0.5), pluck()) as w,
    ):
        w.until(lambda: w.nodes[-1].done)


def test_missing_poses_are_named():
    with (
        pytest.raises(MeasurementError, match='object_pose: no message'),
        world(lambda: Pluck(overrides(wait_time=1.0))) as w,
    ):
        w.until(lambda: w.nodes[-1].done)
