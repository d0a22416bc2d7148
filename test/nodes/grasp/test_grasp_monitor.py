# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reports of the monitor for samples, without a middleware and a clock."""

from dataclasses import replace
import math

from isotruss_ros import core
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.grip_record import GripEstimate, GripRecord
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.inputs import LatestInputs, RejectedInput, RollerState, StampedInput
from isotruss_ros.nodes.grasp.grasp_monitor import GraspMonitor
from isotruss_ros.nodes.grasp.grasp_report import GraspCode, GraspQuery
import numpy as np
import pytest

ROBOT = core.load_robot('nine_member')
DIAMETER, FRICTION, SPACING = 0.3, 0.5, 0.005
CENTER = core.tangent_center(ROBOT.home, 'north/Z', DIAMETER, shift=0.01)
POSE = core.Pose(*CENTER, 0.0)
HOME = np.zeros(len(ROBOT.roller_names))
NOW, TIMEOUT = 1000.0, 0.2
WRENCH = (0.5, -2.0, 0.1)


def at(positions, velocities=0.0 * HOME):
    return RollerState(np.asarray(positions, dtype=float), np.asarray(velocities))


def question(**changes):
    body = core.ConvexObject.disc(CENTER, DIAMETER)
    return GraspQuery((), body, FRICTION, (0.0, 0.0, 0.0), SPACING)._replace(**changes)


def monitor(query=None, **changes):
    result = GraspMonitor(ROBOT, query or question(), TIMEOUT, LatestInputs())
    inputs = {'rollers': at(HOME), 'pose': POSE, 'wrench': WRENCH}
    inputs = {name: StampedInput(value, NOW) for name, value in inputs.items()}
    for name, value in (inputs | changes).items():
        setattr(result.inputs, name, value)
    return result


def test_forces_are_those_of_the_grip_that_the_loop_has():
    grip = attach_grip(ROBOT.home, core.ConvexObject.disc(CENTER, DIAMETER))
    grip = roll_grip(replace(grip, anchors=grip.anchors - np.array([0.002, -0.002])), ROBOT.home)
    displaced = np.zeros(12), np.zeros((12, 6))
    estimate = GripEstimate(np.array(POSE), np.eye(3), 20.0, 3.0, 0.0, *displaced)
    record = StampedInput(GripRecord.of(grip, estimate, is_assumed=True), NOW)
    report = monitor(held_grip=record, wrench=None).report(NOW)
    assert (report.squeeze_deviation, report.is_squeeze_assumed) == (3.0, True)
    assert math.isnan(monitor().report(NOW).squeeze_deviation)
    result = report.grasp.settled
    assert result.slip_margin == pytest.approx(grip.slip_margin(FRICTION), rel=1e-3)
    assert list(result.normal_forces.values()) == pytest.approx(grip.normal_forces, rel=1e-3)
    loaded = roll_grip(grip, ROBOT.home, np.array(WRENCH)).slip_margin(FRICTION)
    under_load = monitor(held_grip=record).report(NOW).grasp.settled
    assert under_load.slip_margin == pytest.approx(loaded, rel=1e-3)
    without = monitor(wrench=None).report(NOW).grasp.settled
    assert without.slip_margin != pytest.approx(result.slip_margin, rel=0.05)


@pytest.mark.parametrize('is_loop', [False, True])
def test_chance_is_that_of_the_files_uncertainty(is_loop):
    block = {'friction': 0.05, 'roller_offset': 0.002}
    body = core.ConvexObject.disc(CENTER, DIAMETER)
    record = StampedInput(GripRecord.of(attach_grip(ROBOT.home, body)), NOW) if is_loop else None
    chances = []
    for about in (body, replace(body, uncertainty=block)):
        query = question(body=about, friction=0.63)
        report = monitor(query, wrench=None, held_grip=record).report(NOW)
        chances.append(report.grasp.chance)
    settled = core.settle_grasp(ROBOT.home, body, 0.63)
    expected = settled.chance(core.Uncertainty.of(ROBOT, about)).probability
    assert math.isnan(chances[0])
    assert 0.1 < chances[1] < 0.99
    assert chances[1] == pytest.approx(expected, abs=0.01)


def test_time_of_the_result_is_that_of_the_older_input():
    rollers, pose = StampedInput(at(HOME), NOW - 0.1), StampedInput(POSE, NOW - 0.05)
    assert monitor(rollers=rollers, pose=pose).report(NOW).time == NOW - 0.1
    assert monitor(pose=pose).report(NOW).time == NOW - 0.05
    assert monitor(pose=None).report(NOW).time == NOW


def figures_of(grasp):
    analysis = grasp.analysis
    return analysis.normal_forces.tolist(), analysis.closure_residual, grasp.settled.slip_margin


def test_computes_only_when_something_has_changed():
    live = monitor()
    first = live.report(NOW).grasp
    later = NOW + 0.1
    live.inputs.rollers = StampedInput(at(HOME, HOME + 0.01), later)
    live.inputs.pose = StampedInput(core.Pose(*POSE), later)
    report = live.report(later)
    assert report.grasp is first
    assert report.time == later
    for name, value in (
        ('rollers', StampedInput(at(HOME + 1e-9), later)),
        ('pose', StampedInput(POSE._replace(y=POSE.y + 1e-9), later)),
        ('wrench', StampedInput((0.5, -2.0, 0.1 + 1e-9), later)),
        ('query', question(body=core.ConvexObject.disc(CENTER, DIAMETER + 1e-9))),
        ('query', question(friction=FRICTION + 1e-9)),
        ('query', question(spacing=SPACING + 1e-9)),
    ):
        before = live.report(later).grasp
        setattr(live if name == 'query' else live.inputs, name, value)
        after = live.report(later).grasp
        assert after is not before, name
        assert figures_of(before) != figures_of(after)
        assert live.report(later).grasp is live.report(later).grasp, name


def test_an_object_without_equilibrium_is_reported_as_such():
    report = monitor(wrench=StampedInput((0.0, 60.0, 0.0), NOW)).report(NOW)
    assert report.code is GraspCode.OK
    assert report.message.startswith('no equilibrium: ')


def test_a_request_does_not_change_the_current_result():
    live = monitor()
    first = live.report(NOW).grasp
    other = live.analyze_request(question(body=core.ConvexObject.disc(CENTER, 0.31)), NOW + 0.05)
    assert other.code is GraspCode.OK
    assert other.time == NOW
    assert other.grasp.analysis.normal_forces.sum() > first.analysis.normal_forces.sum()
    elsewhere = live.analyze_request(question(roller_positions=(0.02, 0, 0, 0, 0, 0)), NOW)
    assert elsewhere.grasp.config.roller_positions[0] == 0.02
    assert live.report(NOW).grasp is first


def test_a_complete_request_needs_no_measured_inputs():
    live = monitor(rollers=None, pose=None, wrench=RejectedInput('broken'))
    reported = live.analyze_request(question(roller_positions=tuple(HOME)), NOW)
    assert reported.code is GraspCode.OK
    assert reported.time == NOW
    for report in (live.analyze_request(question(), NOW), live.report(NOW)):
        assert report.code is GraspCode.NO_JOINT_STATES
        assert not report.force_closure
