# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Gate of a topic, which checks stamp, content and transform of messages before their use."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from isotruss_ros.core.inputs import (
    check_stamp,
    CLOCK_SKEW,
    InputError,
    RejectedInput,
    StampedInput,
)
from isotruss_ros.nodes.conversions.messages import MessageError, read_stamp
from isotruss_ros.nodes.framework.robot_frame import NoTransformError
from isotruss_ros.nodes.framework.runner import StoppableNode
from isotruss_ros.nodes.framework.topics import subscribe_newest
from rclpy.subscription import Subscription

#: Largest number of messages that wait for their transforms [-].
MAX_QUEUED_MESSAGES = 100
#: Largest accepted lead of a stamp over simulated time [s]. A message may arrive before the /clock
#: message of its time, by up to the longest cycle of a node.
SIMULATED_CLOCK_SKEW = 0.1


class Gate:
    """
    Gate that checks the messages of a topic, and passes on a value or a reason of rejection.

    A message whose transform is not known yet is queued until it exceeds the largest age.

    :ivar subscription: subscription of the topic.
    :param node: subscribing node, whose clock is compared with the stamps. A message without a
        header is stamped at reception.
    :param kind: type of the messages.
    :param topic: relative name of the topic.
    :param name: name of the input, with underscores for spaces.
    :param read: function that returns the value of a message, or None if the message is ignored.
        It raises MessageError for an invalid message.
    :param take: callback that receives a `StampedInput`, whose time is not in the future, or a
        `RejectedInput`.
    :param timeout: function that returns the name of the parameter of the timeout, and its value,
        which is the largest age [s].
    :param every: whether all messages are processed, not only the newest.
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
        simulated = node.get_parameter('use_sim_time').value
        self._skew = SIMULATED_CLOCK_SKEW if simulated else CLOCK_SKEW
        #: Queued messages, each with the reason why it is queued.
        self._waiting: deque[tuple[Any, str]] = deque(maxlen=MAX_QUEUED_MESSAGES)
        self.subscription: Subscription = subscribe_newest(node, kind, topic, self.receive, every)

    def receive(self, message: Any) -> None:
        """
        Check a message, and pass its value or the reason of its rejection on, or queue it.

        :param message: message of the topic.
        """
        self._waiting.append((message, ''))
        self.settle()

    def settle(self) -> None:
        """Check the queued messages again."""
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
        """Discard the queued messages."""
        self._waiting.clear()

    def _pass_on(self, message: Any) -> None:
        """Pass the value of a valid message on."""
        time = now = self._node.now()
        if hasattr(message, 'header'):
            setting, timeout = self._timeout()
            time = check_stamp(
                self._name, read_stamp(message.header), now, timeout, setting, self._skew
            )
        value = self._read(message)
        if value is not None:
            self._take(StampedInput(value, time))
