# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Detection of another node on the command topic."""

from isotruss_ros.core import Status
from isotruss_ros.nodes.framework.commands import RollerCommands, TOPIC
from isotruss_ros.nodes.framework.cycle import PacedExecutor
from isotruss_ros.nodes.framework.runner import StoppableNode
from isotruss_ros.nodes.manipulation.node import Manipulation
from probe import begin_context, DEADLINE, N, overrides, world
import pytest
import rclpy
from std_msgs.msg import Float64MultiArray

OWN = [1, 2, 3]


class SilentNode:
    """Publishes nothing."""

    def advertise(self, *_arguments):
        return self

    def publish(self, _message):
        """Forget it."""


class CommandingNode(StoppableNode):
    """Executes callbacks, one of each subscription in a turn."""

    node_name = 'commanding'
    specs = ()


def find_others(numbers):
    """Publish three times, receive messages with such numbers, and return who else commands."""
    commands = RollerCommands(SilentNode(), N)
    for _ in OWN:
        commands.stop()
    for number in numbers:
        commands.note({'publication_sequence_number': number})
    return commands.find_others()


@pytest.mark.parametrize('numbers', [[], OWN, [2], [1, 3], [None, None, None, None]])
def test_own_commands_are_not_those_of_others(numbers):
    assert find_others(numbers) is None


@pytest.mark.parametrize('other', [1, 2, 3, 4, 1000])
@pytest.mark.parametrize('place', range(4))
def test_a_command_of_another_node_is_noticed_whatever_its_number(other, place):
    assert 'another node publishes' in find_others([*OWN[:place], other, *OWN[place:]])


def test_commands_of_another_node_are_noticed_behind_own_ones_of_the_same_rate():
    begin_context()
    node = CommandingNode()
    try:
        commands, other = RollerCommands(node, N), node.advertise(Float64MultiArray, TOPIC)
        commands.subscribe()
        executor = PacedExecutor(node)
        for _ in range(20):
            commands.stop()
            other.publish(Float64MultiArray(data=[0.0] * N))
            executor.spin_once(DEADLINE)
        assert commands.find_others() is not None
    finally:
        node.destroy_node()
        rclpy.shutdown()


def test_commands_of_another_publisher_count_until_it_is_quiet():
    with world(lambda: Manipulation(overrides(rate=50.0))) as w:
        zeros = Float64MultiArray(data=[0.0] * N)
        w.until_code(Status.HALT_OTHER_COMMANDS, lambda: w.probe.commands.publish(zeros))
        w.until_code(Status.HALT_NO_TWIST, lambda: None)
