# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Signs of life of a browser that has control."""

from __future__ import annotations

import contextlib
import threading
import time
import warnings

import viser

#: Between an answer and the next question [s]; a question is given up after `GIVEN_UP`.
PERIOD, GIVEN_UP = 0.1, 1.0
#: Key of the browser's storage that is asked for; it need not be there.
KEY = 'heartbeat'

# A question may meet a browser that is just closed.
warnings.filterwarnings('ignore', 'Queued a LocalStorageGetItemRequestMessage on a closed')


class Heartbeat:
    """
    Ask a page a question that it answers where it handles what it shows, again and again.

    What the page sends of its own is a sign of life, too.

    :ivar last: when the last one came, at first the time of the construction [s], on the
        monotonic clock.
    :param client: the browser.
    """

    def __init__(self, client: viser.ClientHandle) -> None:
        self._client, self._ended = client, threading.Event()
        self.note()
        threading.Thread(target=self._ask, daemon=True).start()

    def note(self) -> None:
        """Take note of a sign of life."""
        self.last = time.monotonic()

    def end(self) -> None:
        """Ask no more."""
        self._ended.set()

    def _ask(self) -> None:
        while not self._ended.wait(PERIOD):
            with contextlib.suppress(TimeoutError):
                # A page that may not read its storage answers so, too.
                with contextlib.suppress(RuntimeError):
                    self._client.local_storage.get_item(KEY, GIVEN_UP)
                self.note()
