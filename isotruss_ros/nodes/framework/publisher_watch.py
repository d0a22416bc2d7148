# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Detection of several publishers that send the same input, whose values contradict each other.

Messages do not name their publisher, but each publisher numbers its messages. Numbers that do not
follow each other come from several publishers, from a publisher that was restarted, or after lost
messages; the graph of nodes excludes the last two. Publishers of different parts of an input, such
as two broadcasters of joint states, do not contradict each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math
import time

from rclpy.node import Node

#: Time for which a conflict is reported after the last change of the publisher [s].
CONFLICT_DURATION = 2.0


class PublisherWatch:
    """
    Detector of publishers that send the same part of an input alternately.

    Without numbers of messages, as in Cyclone DDS, they are not detected.

    :param topic: relative name of the topic.
    :param counts_gaps: whether a gap in the numbers, by which messages may also be lost, is a
        change of the publisher; otherwise only numbers that run back are.
    """

    def __init__(self, node: Node, topic: str, counts_gaps: bool) -> None:
        self._node, self._topic, self._counts_gaps = node, topic, counts_gaps
        #: Number and value of the last message of each part.
        self._last: dict[str, tuple[int, Sequence[float]]] = {}
        self._words, self._changed, self._end = '', -math.inf, -math.inf

    @property
    def conflict(self) -> str:
        """Return a text that names the publishers and their values; empty without a conflict."""
        return self._words if time.monotonic() < self._end else ''

    def find_fault(self, parts: Mapping[str, Sequence[float]], number: int | None) -> str:
        """
        Return the reason why a message may be that of another publisher, otherwise ''.

        :param parts: value of each part of the input in the message.
        :param number: number of the message; None if it is unknown.
        """
        fault, runs_back = '', False
        for part, value in parts.items() if number is not None else ():
            last, before = self._last.get(part, (number - 1, value))
            self._last[part] = number, value
            if number <= last or (self._counts_gaps and number > last + 1):
                runs_back |= number <= last
                fault = fault or self._describe(part, before, value)
        if fault and runs_back:
            now = time.monotonic()
            if now - self._changed < CONFLICT_DURATION:
                self._words = self.conflict or fault  # as it began
                self._end = now + CONFLICT_DURATION
            self._changed = now
        return self.conflict or fault

    def _describe(self, part: str, before: Sequence[float], value: Sequence[float]) -> str:
        """Return a text about the publishers of a part; empty if the graph has only one."""
        # Counting takes a tenth of the time of reading the names.
        if self._node.count_publishers(self._node.resolve_topic_name(self._topic)) < 2:
            return ''
        names = sorted(
            f'{publisher.node_namespace.rstrip("/")}/{publisher.node_name}'
            for publisher in self._node.get_publishers_info_by_topic(self._topic)
        )
        what = f'{self._topic} of {part}' if part else self._topic
        values = f' {" and ".join(map(_in_words, (before, value)))}' if value else ''
        return (
            f'{what} has {len(names)} publishers ({", ".join(names)}), of which two '
            f'send{values}: end one of them'
        )


def _in_words(value: Sequence[float]) -> str:
    numbers = ', '.join(f'{number:.4g}' for number in value)
    return f'({numbers})' if len(value) > 1 else numbers
