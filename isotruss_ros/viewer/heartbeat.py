# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Signs of life of the pages of a view, and what they show where the server gives none.

A script in the page lets its main thread send a message ten times a second, over the websocket of
viser: through its worker, which the script knows from its construction. The clock is a worker of
the script, since a browser slows the timers of hidden pages down. The message is one of viser that
answers a question which nobody asked.
"""

from __future__ import annotations

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


class Heartbeats:
    """
    Keep when each page gave its last sign of life.

    :param server: of the pages, with `SCRIPT` in each.
    """

    def __init__(self, server: viser.ViserServer) -> None:
        self._last: dict[int, float] = {}
        # There is no public way to hear of a message that viser does not handle.
        server._websock_server.register_handler(
            LocalStorageGetItemResponseMessage, lambda browser, _: self.note(browser)
        )

    def note(self, browser: int) -> None:
        """
        Take note of a sign of life.

        :param browser: number of the browser.
        """
        self._last[browser] = time.monotonic()

    def is_silent(self, browser: Any, now: float, timeout: float) -> bool:
        """
        Return whether a browser of which a sign was noted gave none for long.

        :param browser: its number; None for none.
        :param now: on the monotonic clock [s].
        :param timeout: how long [s].
        """
        return now - self._last.get(browser, now) > timeout
