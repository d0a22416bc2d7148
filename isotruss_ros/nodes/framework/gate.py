# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The gate for what comes on a topic: stamp, content and transform are checked before its use."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from isotruss_ros.core.control.inputs import (
    check_stamp,
    InputError,
    RejectedInput,
    StampedInput,
)
from isotruss_ros.nodes.conversions.messages import MessageError, read_stamp
from isotruss_ros.nodes.framework.robot_frame import NoTransformError
from isotruss_ros.nodes.framework.runner import StoppableNode
from isotruss_ros.nodes.framework.topics import subscribe_each, subscribe_newest
from rclpy.subscription import Subscription

#: So many messages of a topic wait for their transforms.
MAX_WAITING = 100


class Gate:
    """
    Check messages of a topic, and pass on their values or why they are rejected.

    A message whose transform is not there yet waits for it, up to the largest age.

    :ivar subscription: to the topic.
    :param node: subscribes; its clock is that of the stamps. Messages without a header hold for
        when they are received.
    :param kind: type of the messages.
    :param topic: relative name of the topic.
    :param name: of the input, with underscores for spaces.
    :param read: returns the value of a message, None for one that is no input; raises MessageError
        for one that is unusable.
    :param take: called with a `StampedInput`, whose time is not after now, or a `RejectedInput`.
    :param timeout: returns name and value of the largest age [s].
    :param every: whether all messages count, not only the newest.
    """

    def __init__(
        self,
        node: StoppableNode,
        kind: type,
        topic: str,
        name: str,
        read: Callable[[Any], Any],
        take: Callable[[StampedInput | RejectedInput], None],
        timeout: Callable[[], tuple[str, float]],
        every: bool = False,
    ) -> None:
        self._node, self._name, self._read, self._take = node, name, read, take
        self._timeout = timeout
        #: Messages, each with why it waits.
        self._waiting: deque[tuple[Any, str]] = deque(maxlen=MAX_WAITING)
        subscribe = subscribe_each if every else subscribe_newest
        self.subscription: Subscription = subscribe(node, kind, topic, self.receive)

    def receive(self, message: Any) -> None:
        """
        Check a message.

        :param message: of the topic.
        """
        self._waiting.append((message, ''))
        self.settle()

    def settle(self) -> None:
        """Check the messages that wait for their transforms again."""
        for _ in range(len(self._waiting)):
            message, why = self._waiting.popleft()
            try:
                self._pass_on(message)
            except NoTransformError as error:
                self._waiting.append((message, str(error)))
            except MessageError as error:
                self._take(RejectedInput(str(error)))
            except InputError as error:
                self._take(RejectedInput(why) if why else RejectedInput(str(error), error.fault))

    def clear(self) -> None:
        """Drop the messages that wait."""
        self._waiting.clear()

    def _pass_on(self, message: Any) -> None:
        """Pass the value of a message on."""
        time = now = self._node.now()
        if hasattr(message, 'header'):
            setting, timeout = self._timeout()
            time = check_stamp(self._name, read_stamp(message.header), now, timeout, setting)
        value = self._read(message)
        if value is not None:
            self._take(StampedInput(value, time))
