# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The manipulation node, under an executor in this process, with the rest of the world faked."""

from dataclasses import replace
from functools import partial
import math
from pathlib import Path
import re
from types import SimpleNamespace

from isotruss_ros import core
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.safety.shape_guard import ShapeBounds
from isotruss_ros.core.servo.decision import Decision
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
from isotruss_ros.nodes.conversions.messages import read_stamp, read_twist
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.manipulation.servo_settings import make_settings, SPECS, StatusReport
from isotruss_ros.nodes.simulator.node import Simulator
from manual_world import Manager, moving_world, world
import numpy as np
from probe import DIAMETER, MODULE, N, overrides, ROBOT
from probe import manipulation as node
import pytest
from std_srvs.srv import SetBool
from walls import Wall

UNIT = np.eye(N)


def test_a_slow_loop_is_stated_first_in_the_status():
    with moving_world() as w:
        w.busy = lambda: 0.03
        w.spin(2.5, w.probe.send_all)
        slow = r'the loop reaches [23]\d(\.\d)? of 100 Hz'
        assert re.fullmatch(slow, w.probe.last('status').message)
        send = lambda: (w.probe.send_pose(), w.probe.send_twist())  # noqa: E731
        status = w.until_code(core.Status.HALT_STALE_JOINT_STATES, send)
        assert re.match(f'{slow}; ', status.message)


@pytest.mark.parametrize('module', ['south/X', 'east/Y', 'north/R', 'north/P'])
def test_halts_where_another_module_than_the_grip_holds_the_object(module):
    """The object is between the members of each of these modules, but only one of them is near."""
    center = core.tangent_center(ROBOT.home, module, DIAMETER)
    with world(node()) as w:
        send = partial(w.probe.send_all, center=center)
        status = w.until_code(core.Status.HALT_NO_GRASP, send)
        assert re.match('member north/(P-Z|Z-R) does not touch the object', status.message)
        assert 'Name the members' in status.message
        assert not w.command().any()
        w.change(grip_module=module)
        w.until(lambda: w.command().any(), send)


def test_every_parameter_of_the_servo_reaches_it():
    values = {'friction': 0.7, 'pressure_timeout': 9.0, 'squeeze_force': 30.0, 'object_mass': 1.5}
    values |= {'frequency': 8.0, 'expected_load': 4.0, 'zero_deviation': 0.002, 'rate': 50.0}
    values |= {'ambient_pressure': 0.0, 'object_diameter': 0.21, 'grip_module': 'south/P'}
    values |= {'grip': ['north/P-Z', 'north/Z-R'], 'command_timeout': 0.3, 'min_rigidity': 0.21}
    values |= {'min_clearance': 0.011, 'min_object_clearance': 0.013, 'failure_time': 3.0}
    values |= {'min_obstacle_clearance': 0.014, 'obstacle_timeout': 0.7}
    values |= {'slide_along_limits': True}
    assert values.keys() | {'failed_rollers'} == {spec.name for spec in SPECS}, (
        'a parameter of SPECS has a value here, and below what `make_settings` makes of it'
    )

    def settings(**others):
        return make_settings(ROBOT, SimpleNamespace(**values | others), None, 'Z')

    body = core.ConvexObject(core.Disc(0.21), mass=1.5, friction=0.7)
    assert settings() == ServoSettings(
        core.Grip(('north/P-Z', 'north/Z-R'), body),
        period=0.02,
        timeout=0.3,
        joint='Z',
        squeeze=SqueezeSettings(30.0, frequency=8.0, load=4.0, zero_deviation=0.002),
        bounds=ShapeBounds(0.21, 0.011, 0.013, min_obstacle_clearance=0.014),
        failure_time=3.0,
        pressure_timeout=9.0,
        obstacle_timeout=0.7,
    )
    assert settings(slide_along_limits=False).slide_along_limits is False
    assert settings(squeeze_force=0.0).squeeze is None
    assert settings(failure_time=0.0).failure_time == math.inf
    assert settings(grip=['']).grip.members == members_at(ROBOT, 'south/P')


@pytest.mark.parametrize('squeeze', [(30.0, 2.0), None])
def test_status_message_contains_all_fields_of_a_decision(squeeze):
    achieved = np.array([0.1, 0.2, 0.3])
    command = RollerCommand(np.zeros(N), achieved, 0.4, core.Status.SLIDING, (), 2)
    twist, failed = np.array([0.5, 0.6, 0.7]), ROBOT.roller_names[1:3]
    decision = Decision(command, twist, 'why', failed, 8.0, 1.5, squeeze, 0.03)
    with world(node(autostart=False)) as w:
        report = StatusReport(w.nodes[1], ROBOT)
        assert all(map(Manager(w, 'manipulation').ask, Manager.UP))
        report.publish(decision, None, 2.5)
        w.deliver()
        status = w.probe.last('status')
    assert (read_stamp(status.header), status.header.frame_id) == (2.5, 'truss')
    assert (status.code, status.message) == (core.Status.SLIDING, 'why')
    assert read_twist(status.achieved) == (0.1, 0.2, 0.3)
    assert read_twist(status.commanded) == (0.5, 0.6, 0.7)
    assert (status.scale, status.reachable_dof) == (0.4, 2)
    assert tuple(status.failed_rollers) == failed
    assert (status.frequency, status.pose_gain, status.pose_delay) == (8.0, 1.5, 0.03)
    published = (status.squeeze, status.squeeze_deviation)
    assert published == pytest.approx(squeeze or (math.nan, math.nan), nan_ok=True)


def test_whole_numbers_are_taken_for_real_parameters():
    """As `-p rate:=100` and `ros2 param set` give them."""
    with world(node(rate=100)) as w:
        assert w.nodes[1].get_parameter('rate').value == 100.0
        w.change(rate=50)
        assert w.nodes[1].get_parameter('rate').value == 50.0
        (result,) = w.nodes[1].set_parameters(overrides(rate=0))
        assert not result.successful
        assert 'range' in result.reason


def test_an_unknown_parameter_causes_a_warning_with_the_most_similar_name(capfd):
    with world(node(gripmodule=MODULE, zzz=1.0)):
        pass
    said = capfd.readouterr().err
    assert 'parameter gripmodule: unknown, and not used; did you mean grip_module?\n' in said
    assert 'parameter zzz: unknown, and not used\n' in said


def test_a_user_robot_file_and_its_frame_are_used(tmp_path):
    preset = Path(ROBOT.description.source).with_name('triangle.yaml')
    mine = tmp_path / 'mine.yaml'
    mine.write_text(preset.read_text().replace('frame: truss', 'frame: lab'))
    parameters = {'robot': str(mine), 'grip_module': 'main/T', 'command_timeout': 1.0}
    with world(lambda: Simulator(overrides(**parameters)), node(**parameters)) as w:
        status = w.until_code(core.Status.IDLE, lambda: w.probe.send_twist((0.0, 0.0, 0.0)))
        assert status.header.frame_id == w.probe.last('pose').header.frame_id == 'lab'


def test_cmd_vel_moves_the_joint_without_an_object_pose():
    velocity = (0.01, -0.02)
    with world(node(mode='joint', joint='Z')) as w:
        status = w.until_code(
            core.Status.OK, lambda: (w.probe.send_joints(), w.probe.send_twist((*velocity, 0.0)))
        )
        expected = core.solve_joint_velocity(ROBOT.home, {'Z': velocity}).roller_velocities
        assert w.command() == pytest.approx(expected, abs=1e-12)
        assert (status.achieved.linear.x, status.achieved.linear.y) == pytest.approx(velocity)
        assert status.reachable_dof == 2


def test_the_service_switches_and_halts_first():
    with moving_world(joint='Z') as w:
        assert w.command().any()
        for wanted, name, moved in ((True, 'joint', 'joint Z'), (False, 'object', 'object')):
            response = w.call('set_joint_mode', SetBool.Request(data=wanted))
            assert (response.success, response.message) == (True, f'cmd_vel moves the {moved}')
            assert w.nodes[1].get_parameter('mode').value == name
            assert not w.command().any()
            w.spin(0.05, w.probe.send_joints)
            assert w.code() == core.Status.HALT_NO_TWIST
            w.until_code(core.Status.OK, w.probe.send_all)


def test_the_service_refuses_the_joint_mode_without_a_joint():
    with world(node()) as w:
        response = w.call('set_joint_mode', SetBool.Request(data=True))
        assert not response.success
        assert 'no such joint' in response.message
        assert w.nodes[1].get_parameter('mode').value == 'object'


class Careful(Manipulation):
    """The node with a limit of its own."""

    def prepare(self, settings):
        return replace(settings, limits=(Wall(np.vstack((UNIT, -UNIT)), np.full(2 * N, 1e-4)),))


def test_a_user_defined_limit_persists_when_parameters_change():
    with world(lambda: Careful(overrides(failure_time=0.0, slide_along_limits=False))) as w:
        for change in (
            lambda: None,
            lambda: w.change(min_clearance=0.03),
            Manager(w, 'manipulation').restart,
        ):
            change()
            w.probe.seen['status'].clear()
            assert 'wall' in w.until_code(Wall.status, w.probe.send_all).message
