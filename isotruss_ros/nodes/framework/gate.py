# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Gate of a topic, which checks stamp, content and transform of each message before it is used."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
import math
from typing import Any, NamedTuple

from isotruss_ros.core.inputs import (
    check_stamp,
    CLOCK_SKEW,
    InputError,
    RejectedInput,
    StampedInput,
)
from isotruss_ros.nodes.conversions.messages import ForeignMessageError, MessageError, read_stamp
from isotruss_ros.nodes.framework.publisher_watch import PublisherWatch
from isotruss_ros.nodes.framework.robot_frame import NoTransformError
from isotruss_ros.nodes.framework.runner import StoppableNode
from isotruss_ros.nodes.framework.topics import subscribe_numbered
from rclpy.subscription import Subscription

#: Checked message, or the reason of its rejection.
Received = StampedInput | RejectedInput
#: Largest number of messages that wait for their transforms [-].
MAX_QUEUED_MESSAGES = 100
#: Largest accepted time by which a stamp may be ahead of simulated time [s]. A message may arrive
#: before the /clock message of its time, by up to the longest cycle of a node.
SIMULATED_CLOCK_SKEW = 0.1


class ForeignMessage(RejectedInput):
    """Reason why a message contains no part of the input; used only before the first part."""


class Topic(NamedTuple):
    """Topic of an input, with the type, conversion and validity rule of its messages."""

    kind: type  #: type of the messages
    topic: str  #: relative name of the topic
    #: function that returns the value of a message; it raises MessageError for an invalid message,
    #: and ForeignMessageError for one without a part of the input, whose stamp is not checked
    read: Callable[[Any], Any]
    words: str = ''  #: name of the input in texts; empty: the name of the topic
    #: whether an invalid message invalidates the input, which stops the robot at once; otherwise
    #: the previous value remains valid
    stops: bool = False
    timeout: str = 'command_timeout'  #: parameter with the largest age
    #: function that merges a message, which contains a part of the input, with earlier messages at
    #: the current time [s]; it returns None as long as parts are missing
    merge: Callable[[Received, float], Received | None] | None = None
    #: function that returns the value of each part of the input in a message by the part's name
    parts: Callable[[Any], Mapping[str, Sequence[float]]] = lambda _: {'': ()}
    #: whether several publishers may send the whole input, such as twists, of which the last is
    #: executed; they are reported, but not rejected
    shared: bool = False


class Gate:
    """
    Gate that checks each message of a topic, and passes on its value or a rejection.

    A message whose transform has not arrived yet is queued until it exceeds the largest age.

    :ivar waiting: queued messages, each with the reason for waiting and a fault of its publisher.
    :ivar words: name of the input in texts for users.
    :param take: callback that receives a `StampedInput`, whose time is not in the future, or a
        `RejectedInput`, and the current time [s].
    :param oldest: largest age of a message [s]; None: the value of the topic's parameter.
    :param every: True to process all messages; otherwise only the newest messages are processed.
    """

    def __init__(
        self,
        node: StoppableNode,
        topic: Topic,
        take: Callable[[Received, float], None],
        oldest: float | None,
        every: bool,
    ) -> None:
        self._node, self._take, self._topic, self._every = node, take, topic, every
        self.words = topic.words or topic.topic.replace('_', ' ').replace('/', ' ')
        self._name = self.words.replace(' ', '_')
        self._oldest, self._setting = oldest, '' if oldest else topic.timeout
        simulated = node.get_parameter('use_sim_time').value
        self._skew = SIMULATED_CLOCK_SKEW if simulated else CLOCK_SKEW
        self.waiting: deque[tuple[Any, str, str]] = deque(maxlen=MAX_QUEUED_MESSAGES)
        self._stamped = math.nan, math.nan  # stamp and time of the last message
        self._publishers = PublisherWatch(node, topic.topic, counts_gaps=not topic.stops)
        self.subscription: Subscription = subscribe_numbered(
            node, topic.kind, topic.topic, self.receive, every
        )

    @property
    def conflict(self) -> str:
        """Return a text about several publishers of the input; empty without a conflict."""
        return self._publishers.conflict

    def receive(self, messages: Sequence[tuple[Any, int | None]]) -> None:
        """
        Check messages, then pass on their values, report their rejections or queue them.

        :param messages: messages with the numbers that their publishers gave them.
        """
        find_fault, parts = self._publishers.find_fault, self._topic.parts
        faults = [find_fault(parts(message), number) for message, number in messages]
        if self._topic.shared:
            faults = [''] * len(messages)
        checked = [
            (message, '', fault) for (message, _), fault in zip(messages, faults, strict=True)
        ]
        self.waiting.extend(checked if self._every else checked[-1:])
        self.settle()

    def settle(self) -> None:
        """Check the messages again that were queued for their transforms."""
        now = self._node.now()
        for _ in range(len(self.waiting)):
            message, why, fault = self.waiting.popleft()
            try:
                self._pass_on(message, fault, now)
            except NoTransformError as error:
                self.waiting.append((message, str(error), fault))
            except ForeignMessageError as error:
                self._take(ForeignMessage(str(error)), now)
            except MessageError as error:
                self._take(RejectedInput(str(error)), now)
            except InputError as error:
                source = ', '.join([part for part in self._topic.parts(message) if part][:3])
                words = f'{error}; message of {source}' if source else str(error)
                rejected = RejectedInput(why) if why else RejectedInput(words, error.fault)
                self._take(rejected, now)

    def _pass_on(self, message: Any, publisher_fault: str, now: float) -> None:
        """Pass on the value of a valid message to the callback."""
        value, fault = None, None
        try:
            value = self._topic.read(message)
        except ForeignMessageError:
            raise
        except MessageError as error:  # a fault of the stamp is reported first
            fault = error
        if publisher_fault:
            raise MessageError(publisher_fault)
        time = now
        if hasattr(message, 'header'):
            setting, stamp = self._setting, read_stamp(message.header)
            oldest = self._oldest or getattr(self._node.values, setting)
            time = check_stamp(self._name, stamp, now, oldest, setting, self._skew)
            if stamp == self._stamped[0]:  # a repetition of a stamp that was in the future
                time = min(time, self._stamped[1])
            self._stamped = stamp, time
        if fault is not None:
            raise fault
        self._take(StampedInput(value, time), now)
