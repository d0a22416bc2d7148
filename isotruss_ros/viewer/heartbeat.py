# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Heartbeats that the pages of a view send, and the notice in a page that has lost the server.

A script in the page sends a message ten times a second from the page's main thread. It uses
viser's websocket through viser's worker, which the script captures when the page creates it. The
messages are timed by another worker, because browsers slow down the timers of hidden pages. In
viser's protocol the heartbeat has the type of a response, but belongs to no request.
"""

from __future__ import annotations

from collections import deque
import time
from typing import Any

import viser
from viser._messages import LocalStorageGetItemResponseMessage

SCRIPT = """<script>
{
  const Plain = window.Worker, workers = [], notice = document.createElement('div');
  notice.textContent = 'No connection: what is shown has ended. The viewer may have stopped.';
  notice.style = 'position: fixed; inset: 0; z-index: 9999; display: grid; place-items: center;'
    + 'background: #fffc; color: #b00; font: bold 28px sans-serif; text-align: center';
  window.Worker = class extends Plain {
    constructor(...given) {
      super(...given);
      workers.push(this);
      this.addEventListener('message', ({ data }) => {
        if (data.type === 'connected') notice.remove();
        if (data.type === 'closed') document.body.append(notice);
      });
    }
  };
  const clock = 'setInterval(() => postMessage(0), 100)';
  const message = {
    type: 'LocalStorageGetItemResponseMessage', request_uuid: '', value: null, error: null
  };
  new Plain(URL.createObjectURL(new Blob([clock]))).onmessage = () => {
    for (const worker of workers) worker.postMessage({ type: 'send', message });
  };
}
</script>
"""


#: Ratio of the timeout to the longest recent pause between heartbeats of a page that draws slowly
#: [-], and largest timeout of such a page [s]. At two pictures a second, the timeout is 1 s. With
#: a third of the ratio, control would end between two pictures; with three times of it, or of the
#: bound, the object would move on three times as long after the page has frozen.
TIMEOUT_RATIO, LONGEST_TIMEOUT = 2.0, 2.0
#: Time for which pauses are stored [s].
PAUSE_DURATION = 5.0


class Heartbeats:
    """Times of the heartbeats of all pages."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._last: dict[int, float] = {}
        #: End and length of the recent pauses of each browser [s].
        self._pauses: dict[int, deque[tuple[float, float]]] = {}
        # viser has no public callback for unhandled messages.
        server._websock_server.register_handler(
            LocalStorageGetItemResponseMessage, lambda browser, _: self.note(browser)
        )

    def note(self, browser: int) -> None:
        """Record the time of a heartbeat from a browser."""
        now = time.monotonic()
        pauses = self._pauses.setdefault(browser, deque())
        pauses.append((now, now - self._last.get(browser, now)))
        while pauses[0][0] < now - PAUSE_DURATION:
            pauses.popleft()
        self._last[browser] = now

    def timeout(self, browser: int, least: float) -> float:
        """
        Return the timeout of a browser [s], which is longer for a page that draws slowly.

        A page sends no heartbeats while it draws.

        :param least: timeout of a page that draws fast [s].
        """
        longest = max((pause for _, pause in self._pauses.get(browser, ())), default=0.0)
        return max(least, min(TIMEOUT_RATIO * longest, LONGEST_TIMEOUT))

    def is_silent(self, browser: Any, timeout: float) -> bool:
        """
        Return whether the heartbeat of a browser has timed out.

        :param browser: index of the browser; None: no browser.
        :param timeout: largest time between heartbeats [s].
        """
        now = time.monotonic()
        return now - self._last.get(browser, now) > timeout
