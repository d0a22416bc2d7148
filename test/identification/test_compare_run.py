# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Comparison of measured runs with the model, and files of force gauges."""

from dataclasses import replace
import functools

from held_grips import CORNER, HOME, NINE
from isotruss_ros import core
from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.recording.recorded_cycle import RecordedCycle
from isotruss_ros.core.servo.servo_settings import ServoSettings
from isotruss_ros.identification.gauge import Gauge, read_gauge
from isotruss_ros.identification.hypotheses import compare_run, find_prior
from isotruss_ros.identification.read_run import read_run
from isotruss_ros.identification.report import block, describe
from isotruss_ros.identification.rolled_run import Parameters
from nightly import some_now
import numpy as np
import pytest

FRICTION, MASS = 0.8, 1.0
PERIOD = 0.25
#: Number of intervals of a run [-].
COUNT = 10
#: Standard deviations of the poses [m, m, rad] and of the gauge [N].
POSE_NOISE, GAUGE_NOISE = np.array([2e-4, 2e-4, 1e-3]), 0.05
NOMINAL = tuple(NINE.description.pressures.values())
STILL = np.zeros(3)


@functools.cache
def travels():
    """Return roller travel that closes the grip, moves the object forth and back, and rests."""
    center = core.tangent_center(HOME, 'north/Z', 0.3, 0.012)
    grip = core.Grip(CORNER, core.ConvexObject(core.Disc(0.3)).moved_to((*center, 0.0)))
    commands = [(STILL, 0.0)] * 8 + [(STILL, -0.003)] * 8
    commands += [(np.array([-0.02, -0.016, 0.0]), 0.0)] * 12
    commands += [(np.array([0.02, 0.016, 0.0]), 0.0)] * 12 + [(STILL, 0.0)] * 56
    config, rows = HOME, []
    for twist, opening in commands:
        rows.append(config.roller_positions)
        command = core.solve_twist(config, grip, twist, opening_rate=opening)
        config = config.moved_to(config.roller_positions + PERIOD * command.roller_velocities)
        grip = grip.moved_to(np.array(grip.body.pose) + PERIOD * command.achieved_twist)
    return np.array(rows), grip


def pull_at(number):
    """Return the force of a gauge on the object in a cycle: aside, and later out of the grip."""
    return np.array([1.0 * (44 <= number < 52), -0.12 * max(number - 68, 0)])


def gravity_at(number):
    """Return the gravity in the plane of the robot in a cycle [m/s^2]."""
    return np.array([0.0, 2.5 * (54 <= number < 66)])


@functools.cache
def simulate(friction, stiffness, mass, is_inclined):
    """Return squeeze [N], force and gravity in the plane, pose and status in each cycle."""
    travel, grip = travels()
    center = core.tangent_center(HOME, 'north/Z', 0.3, 0.012)
    body = replace(grip.body.moved_to((*center, 0.0)), mass=MASS)
    simulated, rows = core.ElasticObject(body, friction, stiffness), []
    for number, place in enumerate(travel):
        config, pull, gravity = HOME.moved_to(place), pull_at(number), gravity_at(number)
        simulated.external_wrench = (*(pull + mass * is_inclined * gravity), 0.0)
        simulated.follow(config)
        squeeze = 0.0 if simulated.grasp is None else simulated.grasp.squeeze
        status = core.Status.OK if simulated.dropped is None else core.Status.HALT_NOT_HELD
        rows.append((squeeze, pull, is_inclined * gravity, simulated.pose(config), status))
    return rows, ServoSettings(replace(grip, body=body, friction=FRICTION), PERIOD, 1.0)


def run_elastic(
    friction=FRICTION,
    stiffness=1.0,
    offset=0.0,
    pressure=1.0,
    delay=0,
    creep=0.0,
    mass=MASS,
    pressures_recorded=True,
    is_inclined=True,
):
    """Return the measured run of a plant with these values; the delay is in cycles."""
    travel, random = travels()[0], np.random.default_rng(0)
    rows, settings = simulate(friction, stiffness, mass, is_inclined)
    cycles, readings, poses = [], [], []
    for number, (squeeze, pull, gravity, pose, status) in enumerate(rows):
        now = PERIOD * number
        # With fixed displacements, forces are proportional to the stiffness.
        measured = squeeze * (1.0 - creep * number / len(travel))
        readings.append((now, measured + GAUGE_NOISE * random.standard_normal(), *pull, *gravity))
        poses.append(pose + POSE_NOISE * random.standard_normal(3))
        rollers = travel[number] - offset * np.eye(len(travel[number]))[3]
        inputs = {
            'rollers': StampedInput(RollerState(rollers, *np.zeros((2, len(rollers)))), now),
            'pose': StampedInput(core.Pose(*poses[max(number - delay, 0)].tolist()), now),
        }
        if pressures_recorded:
            inputs['pressures'] = StampedInput(tuple(pressure * np.array(NOMINAL)), now)
        decision = {'status': status, 'message': ''}
        cycles.append(RecordedCycle(number, now, settings, inputs, decision))
    table = np.array(readings)
    gauge = Gauge('gauge', table[:, 0], table[:, 1], table[:, 2:4], table[:, 4:])
    return read_run(cycles, NINE, gauge, COUNT)


WRONG = {
    'friction': {'friction': 0.68, 'is_inclined': False},
    'tube': {'stiffness': 0.5},
    'offsets': {'offset': 0.006, 'pressures_recorded': False},
    'pressure': {'pressure': 0.8},
    'delay': {'delay': 1},
    'creep': {'creep': 0.35},
    'none': {},
}


@functools.cache
def compare(name):
    """Return the comparison of the run with one deviation."""
    return compare_run(run_elastic(**WRONG[name]))


@pytest.mark.parametrize('name', some_now(WRONG, 6))
def test_the_deviating_parameter_is_named(name):
    assert compare(name).named == name, '\n'.join(describe(compare(name)))


@pytest.mark.parametrize(('name', 'true'), [('tube', -0.5), ('friction', 0.68 - FRICTION)])
def test_estimate_is_within_three_deviations_of_the_truth(name, true):
    fit, part = compare(name).hypotheses[name], getattr(Parameters.of(compare(name).run), name)
    assert fit.estimate[part][0] == pytest.approx(true, abs=3.0 * fit.deviation[part][0])


@pytest.mark.parametrize('friction', [0.68, 0.76])
def test_smallest_named_deviation_divides_the_named_runs_from_the_others(friction):
    compared = compare_run(run_elastic(friction=friction, is_inclined=False))
    fit = compared.hypotheses['friction']
    estimate = abs(fit.estimate[Parameters.of(compared.run).friction][0])
    assert (compared.named == 'friction') == (estimate > fit.smallest)
    words = f'named from ±{fit.smallest:.2g} on'
    assert (words in '\n'.join(describe(compared))) == fit.is_determined


def test_a_wrong_mass_is_not_taken_for_another_parameter():
    assert compare_run(run_elastic(mass=1.6)).named in ('none', 'mass')


def test_prior_of_a_measured_interval_of_friction_is_its_deviation():
    run = run_elastic()
    body = replace(run.grip.body, uncertainty={'friction': [0.7, 0.9]})
    prior = find_prior(replace(run, grip=replace(run.grip, body=body)))
    assert prior[Parameters.of(run).friction] == pytest.approx(0.2 / 12.0**0.5)


def test_pressure_and_mass_without_recorded_pressures_and_gravity_are_not_determined():
    compared = compare('friction')
    assert not compare('offsets').hypotheses['pressure'].is_determined
    assert not compared.hypotheses['mass'].is_determined
    assert 'mass of the object: not determined by this run' in '\n'.join(describe(compared))


def test_block_has_the_stiffness_for_the_robot_file():
    lines = block(compare('tube')).splitlines()
    line = next(line for line in lines if 'stiffness_scale' in line)
    assert float(line.split(':')[-1].strip(' }')) == pytest.approx(0.5, abs=0.1)


ROWS = 'time_s,squeeze_N,pull_x_N,pull_y_N\n0.0,9.0,0.0,0.0\n0.5,9.5,0.1,-0.2\n'


def write(folder, text):
    path = folder / 'gauge.csv'
    path.write_text(text, encoding='utf-8')
    return path


def test_forces_are_read_on_the_clock_of_the_run(tmp_path):
    gauge = read_gauge(write(tmp_path, ROWS), zero=100.0)
    assert gauge.times == pytest.approx([100.0, 100.5])
    assert gauge.squeeze == pytest.approx([9.0, 9.5])
    assert gauge.pull == pytest.approx(np.array([[0.0, 0.0], [0.1, -0.2]]))


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('time,squeeze\n0,1\n1,1\n', "the first line is 'time,squeeze': must name once"),
        ('time_s,pull_x_N\n0,1\n1,1\n', 'must name once each'),
        ('time_s,squeeze_N\n0,1\n', '1 rows: must be at least 2'),
        ('time_s,squeeze_N\n0,1\n1,much\n', "line 3: squeeze_N 'much': must be a finite number"),
        ('time_s,squeeze_N\n0,1\n1,nan\n', 'line 3: squeeze_N'),
        ('time_s,squeeze_N\n0,1\n1,14000\n', 'if it is in mN, it is 14 N'),
        ('time_s,squeeze_N\n1,1\n2,1\n2,1\n', 'line 4: time_s 2: must be later than the 2 s'),
        ('time_s,squeeze_N\n0,1\n1\n', 'line 3: squeeze_N None'),
    ],
)
def test_an_invalid_file_is_refused_with_the_value_and_its_range(text, words, tmp_path):
    with pytest.raises(MeasurementError) as caught:
        read_gauge(write(tmp_path, text))
    assert words in str(caught.value)


def test_a_missing_file_is_refused_by_its_name(tmp_path):
    with pytest.raises(MeasurementError, match=r'none\.csv: cannot be read'):
        read_gauge(tmp_path / 'none.csv')


def test_readings_outside_of_the_run_are_refused_with_both_times(tmp_path):
    gauge = read_gauge(write(tmp_path, ROWS))
    with pytest.raises(MeasurementError, match=r'from 0.000 to 0.500 s: .* 100.000 to 120.000 s'):
        gauge.check_overlap(100.0, 120.0)
