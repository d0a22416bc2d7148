# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bytes that are no message, and floods of messages, over DDS."""

from geometry_msgs.msg import Twist, TwistStamped, WrenchStamped
from isotruss_ros.core import Status
from isotruss_ros.demo.processes import NodeProcess
from isotruss_ros.nodes.grasp_analysis import GraspAnalysisNode
from isotruss_ros.nodes.simulator.node import Simulator
from nightly import some_now
import numpy as np
from probe import manipulation, N, ROBOT, world
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64MultiArray

pytestmark = pytest.mark.system


@pytest.mark.parametrize('stamped', some_now([False, True]))
def test_a_publisher_of_the_other_type_of_twist_is_named(tmp_path, stamped):
    """Of another process: in one process a topic has one type."""
    other = Twist if stamped else TwistStamped
    with world(twist_type=other) as w:
        log = tmp_path / 'manipulation.log'
        node = NodeProcess('manipulation', {'use_stamped_twist': stamped}, log)
        try:

            def measured():
                w.probe.send_joints()
                w.probe.send_pose()

            status = w.until_code(Status.HALT_INVALID_TWIST, measured)
            words = f'cmd_vel has a publisher of {other.__name__}, which is not received'
            assert words in status.message
            assert f'set use_stamped_twist to {str(not stamped).lower()}' in status.message
            w.probe.destroy_publisher(w.probe.twists)
            w.until_code(Status.HALT_NO_TWIST, measured)
        finally:
            node.stop()
        assert words in log.read_text()


def test_floods_on_every_input_do_no_harm():
    """As much as this process can send, on every topic at once; the loops turn and stops count."""
    with world(manipulation(), lambda: Simulator(), lambda: GraspAnalysisNode()) as w:
        w.until_code(Status.OK, w.probe.send_twist)
        seen = w.probe.seen['status']
        cycles = len(seen)
        large = JointState(name=[str(i) for i in range(1000)], position=[0.0] * 1000)

        def flood():
            for i in range(20):
                w.probe.send_all()
                w.probe.joint_states.publish(large)
                w.probe.wrenches.publish(WrenchStamped())
                w.probe.commands.publish(Float64MultiArray(data=[0.01 * (-1) ** i] * N))
                w.probe.stops.publish(Bool(data=False))

        w.until(lambda: len(seen) > cycles + 30, flood)
        w.probe.stops.publish(Bool(data=True))
        w.until_code(Status.HALT_EMERGENCY_STOP, lambda: [w.probe.send_all() for _ in range(100)])
        commands = np.array([m.data for _, m in w.probe.seen['command']])
        assert np.abs(commands).max() <= ROBOT.description.max_speed + 1e-9
        w.until(lambda: not w.command().any())
