# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The emergency stop: set by a topic or a service, kept, and released by a service only."""

from __future__ import annotations

from collections.abc import Callable

from isotruss_ros.core import IsotrussError
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.manipulation.sparse_messages import SparseMessages
from std_msgs.msg import Bool

#: Of the topic, and of the service that does the same and answers.
NAME = 'emergency_stop'
RELEASE = 'release_emergency_stop'


class EmergencyStop:
    """
    Keep a stop until it is released, in whatever state the node is.

    :param node: subscribes and offers the services, until it is destroyed.
    :param required: returns whether nothing may move before a message was received.
    :param changed: called when `reason` is another one.
    :param wait_for_zero: returns whether zero velocity is what the drives have, if the node
        commands them; waits for it a moment.
    """

    def __init__(
        self,
        node: ManagedNode,
        required: Callable[[], bool],
        changed: Callable[[], None],
        wait_for_zero: Callable[[], bool],
    ) -> None:
        self._required, self._changed = required, changed
        self._wait_for_zero = wait_for_zero
        self._service = node.resolve_service_name(NAME)
        self._release_service = node.resolve_service_name(RELEASE)
        #: Last message of the topic; None before the first.
        self._last: bool | None = None
        self._stopped = False
        #: What else stops the rollers; the first of the reasons is kept.
        self._cause: str | None = None
        self._messages = SparseMessages(
            node,
            Bool,
            NAME,
            self._receive,
            lambda why: self._stop_for(f'{why}: one of its messages may have been true'),
            every=True,
        )
        node.offer(NAME, self._carry_out_stop)
        node.offer(RELEASE, self._release)

    @property
    def reason(self) -> str | None:
        """Return why the rollers are stopped; None if they are not."""
        if self._stopped:
            last = 'true' if self._last else 'false'
            return (
                f'stopped by the topic {NAME}; its last message is {last}; '
                f'released by the service {self._release_service} only'
            )
        if self._cause is not None:
            return f'{self._cause}; released by the service {self._release_service} only'
        if self._last is None and self._required():
            return f'no message of {NAME} received yet, and require_emergency_stop is set'
        return None

    def _receive(self, messages: list[Bool]) -> None:
        before = self._last, self._stopped
        self._last = messages[-1].data
        self._stopped = self._stopped or any(message.data for message in messages)
        if (self._last, self._stopped) != before:
            self._changed()

    def _stop_for(self, cause: str) -> None:
        """Stop for another reason than a message."""
        if self._cause is None:
            self._cause = cause
            self._changed()

    def _carry_out_stop(self) -> str:
        """Stop, and respond once the drives have received zero."""
        self._stop_for(f'stopped by the service {self._service}')
        if not self._wait_for_zero():
            raise IsotrussError(
                'zero was commanded, but not every subscriber has acknowledged it; '
                + (self.reason or '')
            )
        return self.reason or ''

    def _release(self) -> str:
        if self._last:
            raise IsotrussError(f'the last message of {NAME} is true; publish false first')
        stopped = self._stopped or self._cause is not None
        self._stopped, self._cause = False, None
        self._changed()
        return 'released' if stopped else 'nothing was stopped'
