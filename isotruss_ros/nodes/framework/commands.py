# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Publishers of twists for the node `manipulation`, and of roller velocities."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
import time
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.nodes.conversions.messages import make_header, to_twist_message
from isotruss_ros.nodes.framework.runner import StoppableNode
from isotruss_ros.nodes.framework.topics import (
    ACKNOWLEDGE_TIME,
    NEWEST_MESSAGES,
    NO_EVENTS,
    take_queued,
)
import numpy as np
from std_msgs.msg import Float64MultiArray

TOPIC = 'roller_velocity_controller/commands'
#: Time without commands of other nodes after which the other nodes count as silent [s].
QUIET_TIME = 1.0


class RollerCommands:
    """
    Publisher of roller velocities that also detects commands of other nodes.

    The middleware does not name the publisher of a message, so the node's own messages are
    recognised by their sequence numbers. If the middleware has no sequence numbers, such as
    Cyclone DDS, other nodes are not detected.

    :param node: publishing node; a managed node publishes only while it is active.
    """

    def __init__(self, node: StoppableNode, count: int) -> None:
        self._node, self._count = node, count
        self._publisher = node.advertise(Float64MultiArray, TOPIC)
        #: Sequence numbers of the last message published, and of the last own message received.
        self._sent = self._received = 0
        self._heard = -math.inf

    def subscribe(self) -> None:
        """Start to detect commands of other nodes, until the node is deactivated."""
        self._received, self._heard = self._sent, -math.inf
        self._subscription = self._node.create_subscription(
            Float64MultiArray,
            TOPIC,
            self._receive,
            NEWEST_MESSAGES,
            event_callbacks=NO_EVENTS,
            raw=True,
        )

    def publish(self, velocities: Array) -> None:
        """
        Publish commanded roller velocities.

        :param velocities: (r,) roller velocities [m/s].
        """
        self._publisher.publish(Float64MultiArray(data=velocities.tolist()))
        self._sent += 1

    def stop(self) -> None:
        """Publish zero velocities for all rollers."""
        self.publish(np.zeros(self._count))

    def wait_for_subscribers(self) -> bool:
        """Wait briefly; return whether all subscribers have received the last command."""
        return self._publisher.wait_for_all_acked(ACKNOWLEDGE_TIME)

    def find_others(self) -> str | None:
        """Return a text that names other nodes commanding the rollers; None if there are none."""
        if time.monotonic() - self._heard > QUIET_TIME:
            return None
        return f'another node publishes on {TOPIC}: end or deactivate one of the two nodes'

    def _receive(self, _message: bytes, info: dict[str, Any]) -> None:
        """Record a received command and those queued behind it."""
        self.note(info)
        # The executor passes on one message per cycle: always the node's own if another node
        # commands at the same rate.
        for _, waiting in take_queued(self._subscription, NEWEST_MESSAGES.depth):
            self.note(waiting)

    def note(self, info: dict[str, Any]) -> None:
        """Record a received command of this node or of another node."""
        number = info['publication_sequence_number']
        if number is None:
            return
        if self._received < number <= self._sent:
            self._received = number
        else:
            self._heard = time.monotonic()


def create_twist_publisher(
    node: StoppableNode, stamped: bool, frame: str
) -> Callable[[Sequence[float]], None]:
    """
    Return a function that publishes a twist (vx, vy, omega) [m/s, rad/s] on `cmd_vel`.

    :param node: publishing node; a managed node publishes only while it is active.
    :param frame: name of the frame of a TwistStamped.
    """
    publisher = node.advertise(TwistStamped if stamped else Twist, 'cmd_vel')

    def publish(twist: Sequence[float]) -> None:
        message = to_twist_message(twist)
        if stamped:
            message = TwistStamped(header=make_header(node.now(), frame), twist=message)
        publisher.publish(message)

    return publish
