# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Heartbeats of actions: a goal ends with its client, and a sequence with the server of its goal.

Liveliness and deadline of DDS detect a process that ends as quickly, but their time is fixed when
an entity is made, where `command_timeout` is a parameter; a subscription that asks for them
matches no publisher without; and automatic liveliness goes on where a callback hangs (see
docs/tried.md).
"""

from __future__ import annotations

from collections.abc import Callable
import time

from action_msgs.msg import GoalInfo
from isotruss_ros.nodes.framework.topics import RELIABLE, subscribe_newest
from rclpy.lifecycle import LifecycleNode

#: Clients publish here which goal ends with them, from before they send it.
TOPIC = 'supervised_goal'
#: Feedback is published at most this often [s]: it is the heartbeat of a server.
FEEDBACK_PERIOD = 0.05
#: Within this time at least two messages of feedback come [s].
SHORTEST_SILENCE = 2.0 * FEEDBACK_PERIOD
#: A server may take so long to begin a goal before it must send feedback [s].
BEGINNING = 1.0


def create_heartbeat(node: LifecycleNode) -> Callable[[GoalInfo], None]:
    """
    Return what publishes that a goal still has a client.

    :param node: publishes while it is active.
    """
    return node.create_lifecycle_publisher(GoalInfo, TOPIC, RELIABLE).publish


class ClientWatch:
    """
    When the client of a goal was heard last, if it supervises goals at all.

    :param node: subscribes, until it is destroyed.
    """

    def __init__(self, node: LifecycleNode) -> None:
        self.goal: bytes | None = None
        self._heard = (b'', 0.0)
        subscribe_newest(node, GoalInfo, TOPIC, self._note)

    def find_loss(self, timeout: float) -> str | None:
        """
        Return in words that the client that supervised the active goal has fallen silent.

        :param timeout: longest time between its messages, by the steady clock [s].
        :return: None if it has not.
        """
        goal, heard = self._heard
        if self.goal is None or goal != self.goal or time.monotonic() - heard <= timeout:
            return None
        return (
            f'the client that supervises the goal has not published on {TOPIC} for {timeout} s: '
            'it has ended, or the machine is busy and command_timeout must be longer'
        )

    def _note(self, message: GoalInfo) -> None:
        goal = bytes(message.goal_id.uuid)
        if self.goal is None or goal == self.goal:
            self._heard = goal, time.monotonic()


class ServerWatch:
    """
    When the server of a goal was heard last.

    :param name: of the action.
    :param silence: for how long it may send no feedback [s].
    """

    def __init__(self, name: str, silence: float) -> None:
        self._name, self._silence = name, silence
        self._heard = time.monotonic() + BEGINNING

    def note(self) -> None:
        """Take note of feedback."""
        self._heard = max(self._heard, time.monotonic())

    def find_loss(self) -> str | None:
        """Return in words that the server has fallen silent; None if it has not."""
        if time.monotonic() - self._heard <= self._silence:
            return None
        return (
            f'the action {self._name} has sent no feedback for {self._silence:g} s: its node has '
            'ended, or hangs'
        )
