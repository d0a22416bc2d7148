# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Notice publishers that left before their message was received."""

from __future__ import annotations

from collections.abc import Callable
import math
import time
from typing import Any

#: Between the callbacks with a message and with the match of its publisher, at most [s].
MATCH_DELAY = 1.0


class SilentPublishers:
    """
    Report a publisher that left before any message was received.

    One that is discovered, publishes and exits at once may be gone before this side has matched
    it: then its message is lost, and nothing else tells so.

    :param topic: of the publishers.
    :param read: called to receive what waits.
    :param missing: called with the reason when a message may have been lost.
    """

    def __init__(
        self, topic: str, read: Callable[[], None], missing: Callable[[str], None]
    ) -> None:
        self._topic, self._read, self._missing = topic, read, missing
        #: Publishers that came after the last message.
        self._silent = 0
        self._received = -math.inf

    def note_message(self) -> None:
        """Count the publishers from now on."""
        self._silent, self._received = 0, time.monotonic()

    def follow(self, event: Any) -> None:
        """
        Count a publisher that came, or report one that left.

        :param event: that the subscription matched, as the middleware reports it.
        """
        # The executor may call back with a message before it does so with the match.
        if time.monotonic() - self._received > MATCH_DELAY:
            self._silent += event.total_count_change
        if event.current_count_change == event.total_count_change:
            return
        self._read()
        if self._silent > 0:
            self._silent = 0
            self._missing(f'a publisher of {self._topic} left before a message was received')
