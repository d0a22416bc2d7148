# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The mode of the manipulation node in which cmd_vel moves a joint."""

from isotruss_ros.core import solve_joint_velocity, Status
from manual_world import check_refused, world
from probe import manipulation as node
from probe import ROBOT
import pytest
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool

VELOCITY = (0.01, -0.02)


def send(w):
    """Send joint states and a twist, and no pose of an object."""
    w.probe.send_joints()
    w.probe.send_twist((*VELOCITY, 0.0))


def test_cmd_vel_moves_the_joint_without_an_object_pose():
    with world(node(mode='joint', joint='Z')) as w:
        status = w.until_code(Status.OK, lambda: send(w))
        expected = solve_joint_velocity(ROBOT.home, {'Z': VELOCITY}).roller_velocities
        assert w.command() == pytest.approx(expected, abs=1e-12)
        assert (status.achieved.linear.x, status.achieved.linear.y) == pytest.approx(VELOCITY)
        assert status.reachable_dof == 2


def test_the_service_switches_and_halts_first():
    with world(node(joint='Z')) as w:
        w.until_code(Status.OK, w.probe.send_all)
        assert w.command().any()
        for wanted, name in ((True, 'joint'), (False, 'object')):
            response = w.call('set_joint_mode', SetBool.Request(data=wanted))
            assert response.success, response.message
            assert w.nodes[1].get_parameter('mode').value == name
            assert not w.command().any()
            w.spin(0.05, w.probe.send_joints)
            assert w.code() == Status.HALT_NO_TWIST
            w.until_code(Status.OK, w.probe.send_all)


def test_the_mode_needs_a_joint_that_exists():
    check_refused(node(mode='joint'), 'P, Q, R, X, Y, Z')
    check_refused(node(mode='joints'), 'must be one of')
    check_refused(node(joint='S'), 'no such joint')
    with world(node()) as w:
        response = w.call('set_joint_mode', SetBool.Request(data=True))
        assert not response.success
        assert 'no such joint' in response.message
        (result,) = w.nodes[1].set_parameters([Parameter('joint', value='S')])
        assert not result.successful
        assert w.nodes[1].get_parameter('mode').value == 'object'
