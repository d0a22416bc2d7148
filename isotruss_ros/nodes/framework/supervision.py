# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Heartbeats of actions: a goal ends with its client, a sequence ends with the server of its goal.

Liveliness and deadline of DDS detect an ended process equally fast, but have three faults (see
docs/tried.md). Their time is fixed when an entity is created, whereas `command_timeout` is a
parameter. Subscriptions with them do not match publishers without them. Automatic liveliness
continues while a callback hangs.
"""

from __future__ import annotations

import time

from action_msgs.msg import GoalInfo
from isotruss_ros.nodes.framework.topics import subscribe_newest
from rclpy.lifecycle import LifecycleNode

#: Topic on which a client names the goal that it supervises, before it sends the goal.
TOPIC = 'supervised_goal'
#: Shortest period of feedback, which is the heartbeat of a server [s].
FEEDBACK_PERIOD = 0.05
#: Shortest timeout of feedback, two periods [s].
MIN_FEEDBACK_TIMEOUT = 2.0 * FEEDBACK_PERIOD
#: Longest time from the start of a goal to its first feedback [s].
START_TIMEOUT = 1.0


class ClientWatch:
    """
    Time of the last heartbeat of the client that supervises a goal.

    :param node: node that subscribes until it is destroyed.
    """

    def __init__(self, node: LifecycleNode) -> None:
        self.goal: bytes | None = None
        self._heard = (b'', 0.0)
        subscribe_newest(node, GoalInfo, TOPIC, self._note)

    def find_loss(self, timeout: float) -> str | None:
        """
        Return in words the loss of the supervising client; None without a loss.

        :param timeout: longest time between the client's messages, by the steady clock [s].
        :return: text of the loss, or None.
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
    Time of the last feedback by the server of a goal.

    :param name: name of the action.
    :param silence: longest time without feedback [s].
    """

    def __init__(self, name: str, silence: float) -> None:
        self._name, self._silence = name, silence
        self._heard = time.monotonic() + START_TIMEOUT

    def note(self) -> None:
        """Record feedback."""
        self._heard = max(self._heard, time.monotonic())

    def find_loss(self) -> str | None:
        """Return in words the loss of the server; None without a loss."""
        if time.monotonic() - self._heard <= self._silence:
            return None
        return (
            f'the action {self._name} has sent no feedback for {self._silence:g} s: its node has '
            'ended, or hangs'
        )
