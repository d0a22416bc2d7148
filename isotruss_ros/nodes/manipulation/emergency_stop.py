# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Emergency stop, which is set by a topic or a service and released only by a service."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from isotruss_ros.core import IsotrussError
from isotruss_ros.nodes.manipulation.sparse_messages import SparseMessages
from std_msgs.msg import Bool

if TYPE_CHECKING:
    from isotruss_ros.nodes.framework.managed import ManagedNode

#: Name of the topic, and of the equivalent service.
NAME = 'emergency_stop'
RELEASE = 'release_emergency_stop'


class EmergencyStop:
    """Emergency stop, set in any state of the node and in force until its release."""

    def __init__(
        self,
        node: ManagedNode,
        changed: Callable[[], None],
        wait_for_zero: Callable[[], bool],
    ) -> None:
        self._values, self._changed, self._wait_for_zero = node.values, changed, wait_for_zero
        self._service = node.resolve_service_name(NAME)
        service = node.resolve_service_name(RELEASE)
        self._next_step = f'next step: isotruss release, or the service {service}'
        #: Last message of the topic; None before the first message.
        self._last: bool | None = None
        self._stopped = False
        #: First reason of a stop that is not a message of the topic; None if there is none.
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
        """Return the reason of the stop; None without a stop."""
        if self._stopped:
            last = 'true: publish false' if self._last else 'false'
            return f'stopped by the topic {NAME}; its last message is {last}; {self._next_step}'
        if self._cause is not None:
            return f'{self._cause}; {self._next_step}'
        if self._last is None and self._values.require_emergency_stop:
            return f'no message of {NAME} yet, which require_emergency_stop demands: publish false'
        return None

    def _receive(self, messages: list[Bool]) -> None:
        before = self._last, self._stopped
        self._last = messages[-1].data
        self._stopped = self._stopped or any(message.data for message in messages)
        if (self._last, self._stopped) != before:
            self._changed()

    def _stop_for(self, cause: str) -> None:
        """Stop the robot for a reason other than a message of the topic."""
        if self._cause is None:
            self._cause = cause
            self._changed()

    def _carry_out_stop(self) -> str:
        """Stop the robot, and return a response after the drives have received zero velocity."""
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
