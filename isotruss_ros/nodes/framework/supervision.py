# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Heartbeats, by which the client and the server of an action goal detect each other's loss.

Liveliness and deadline of DDS would detect an ended process as fast, but have drawbacks (see
docs/tried.md). Their timeouts are fixed when an entity is created, whereas the parameter
`command_timeout` can change. Subscriptions with these policies do not match publishers without
them. Automatic liveliness continues while a callback hangs.
"""

from __future__ import annotations

import time

from action_msgs.msg import GoalInfo
from isotruss_ros.nodes.framework.topics import subscribe_newest
from rclpy.lifecycle import LifecycleNode

#: Topic on which a client names a goal that it supervises, before it sends the goal.
TOPIC = 'supervised_goal'
#: Shortest period of feedback, which is the heartbeat of a server [s].
FEEDBACK_PERIOD = 0.05
#: Shortest timeout of feedback, which is two periods [s].
MIN_FEEDBACK_TIMEOUT = 2.0 * FEEDBACK_PERIOD
#: Longest time from the start of a goal to its first feedback [s].
START_TIMEOUT = 1.0


def describe_absence(kind: str, name: str, server: str, duration: float | None = None) -> str:
    """
    Return a text with a remedy for an action or a service that no node offers.

    :param kind: `action` or `service`.
    :param server: name of the node that offers it.
    :param duration: duration of the wait for it [s]; None without a wait.
    """
    waited = '' if duration is None else f' in {duration:g} s'
    remedy = f'check that {server} runs, its namespace, and ROS_DOMAIN_ID'
    return f'no node offers the {kind} {name}{waited}: {remedy}'


class ClientWatch:
    """Detector for the loss of a goal's client, from the time of the client's last heartbeat."""

    def __init__(self, node: LifecycleNode) -> None:
        self.goal: bytes | None = None
        self._heard = (b'', 0.0)
        subscribe_newest(node, GoalInfo, TOPIC, self._note)

    def find_loss(self, timeout: float) -> str | None:
        """
        Return an error text if the client of the goal is lost, otherwise None.

        :param timeout: longest accepted time between the client's heartbeats, by the steady clock
            [s].
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
    Detector for the loss of a goal's server, from the time of the server's last feedback.

    :param silence: longest accepted time without feedback [s].
    """

    def __init__(self, name: str, silence: float) -> None:
        self._name, self._silence = name, silence
        self._heard = time.monotonic() + START_TIMEOUT

    def note(self) -> None:
        """Record that feedback of the server has arrived."""
        self._heard = max(self._heard, time.monotonic())

    def find_loss(self) -> str | None:
        """Return an error text if the server of the goal is lost, otherwise None."""
        if time.monotonic() - self._heard <= self._silence:
            return None
        return (
            f'the action {self._name} has sent no feedback for {self._silence:g} s: its node has '
            'ended, or hangs'
        )
