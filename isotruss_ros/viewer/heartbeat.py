# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Heartbeats, by which pages report the pictures they have drawn, and the notice of a lost server.

The server marks each picture with its time, in an invisible element after the last change. A
script in the page returns the mark once the graphics processor has drawn the frame that contains
it: it puts a fence behind the drawing commands of the scene. So a page sends nothing while it is
hidden, or while its script, its drawing or its connection is frozen. It uses viser's websocket
through viser's worker, which the script captures when the page creates it. In viser's protocol the
heartbeat has the type of a response, but belongs to no request.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Container
import re

import viser
from viser._messages import LocalStorageGetItemResponseMessage

#: Content of the invisible element: a comment in HTML with the time of the picture [s].
MARK = '<!--picture {}-->'
SCRIPT = """<script>
{
  const Plain = window.Worker, workers = [], scenes = [], notice = document.createElement('div');
  const get = HTMLCanvasElement.prototype.getContext;
  const delay = (time) => new Promise((done) => setTimeout(done, time));
  let sent, received;
  notice.textContent = 'No connection: what is shown has ended. The viewer may have stopped.';
  notice.style = 'position: fixed; inset: 0; z-index: 9999; display: grid; place-items: center;'
    + 'background: #fffc; color: #b00; font: bold 28px sans-serif; text-align: center';
  window.Worker = class extends Plain {
    constructor(...parameters) {
      super(...parameters);
      workers.push(this);
      this.addEventListener('message', ({ data }) => {
        if (data.type === 'closed') document.body.append(notice);
        if (data.type === 'connected') {
          notice.remove();
          sent = received = undefined;
        }
        for (const { updates } of data.messages ?? []) {
          received = /^<!--picture (.*)-->$/.exec(updates?.content)?.[1] ?? received;
        }
      });
    }
  };
  HTMLCanvasElement.prototype.getContext = function (kind, ...options) {
    const context = get.call(this, kind, ...options);
    if (kind === 'webgl2' && context && !scenes.includes(context)) scenes.push(context);
    return context;
  };
  // Keys for a slider or a text do not turn the camera, which hears them at the document.
  document.addEventListener('DOMContentLoaded', () => {
    document.body.addEventListener('keydown', (event) => {
      if (event.target.closest('input, textarea, [role=slider]')) event.stopPropagation();
    });
  });
  (async () => {
    for (;;) {
      await new Promise(requestAnimationFrame);
      const value = received;
      await delay(0);  // after the drawing commands of this frame
      const gl = scenes.findLast(({ canvas }) => canvas.isConnected);
      const fence = value !== sent && gl?.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
      if (!fence) continue;
      gl.flush();
      while (!gl.isContextLost() && gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.SIGNALED) {
        await delay(10);
      }
      gl.deleteSync(fence);
      if (gl.isContextLost()) continue;
      sent = value;
      const type = 'LocalStorageGetItemResponseMessage';
      const message = { type, request_uuid: '', value, error: null };
      for (const worker of workers) worker.postMessage({ type: 'send', message });
    }
  })();
}
</script>
"""


#: Ratio of the timeout to the longest recent delay of a picture in a page that draws slowly [-],
#: and largest timeout of such a page [s]. At four pictures a second, the timeout is 1 s. With a
#: third of the ratio, control would end between two pictures; with three times of it, or of the
#: bound, the object would move on three times as long after the page has frozen.
TIMEOUT_RATIO, LONGEST_TIMEOUT = 2.0, 2.0
#: Time for which delays are stored [s].
DELAY_DURATION = 5.0
#: Number of marks that are stored, those of a minute at the highest rate [-].
MAX_MARKS = 3600
#: Name under which heartbeats are queued.
HEARTBEAT = 'heartbeat'


class Heartbeats:
    """
    Delays of the pictures that pages have drawn, behind those that were sent.

    :param queue: function that queues a heartbeat, called in the thread of the server with number
        of the browser, `HEARTBEAT`, and value. Everything else is for the thread of the view.
    """

    def __init__(
        self, server: viser.ViserServer, queue: Callable[[int, str, object], None]
    ) -> None:
        self._mark = server.gui.add_html('', visible=False)
        #: Times of the last marks [s].
        self._marks: deque[float] = deque(maxlen=MAX_MARKS)
        #: Mark of the last picture that each browser has drawn [s].
        self._drawn: dict[int, float] = {}
        #: Time and value of the recent delays of each browser [s].
        self._delays: dict[int, deque[tuple[float, float]]] = {}
        # viser has no public callback for unhandled messages.
        server._websock_server.register_handler(
            LocalStorageGetItemResponseMessage,
            lambda browser, message: queue(browser, HEARTBEAT, message.value),
        )

    def mark(self, now: float) -> None:
        """Mark what was sent until now as a picture."""
        self._marks.append(now)
        self._mark.content = MARK.format(now)

    def note(self, browser: int, value: object, now: float) -> None:
        """Record the heartbeat of a browser, with the mark of the picture that it has drawn."""
        if not re.fullmatch(r'[0-9]+\.[0-9]+', str(value)):
            return
        delays = self._delays.setdefault(browser, deque())
        delays.append((now, self.delay(browser, now)))
        while delays[0][0] < now - DELAY_DURATION:
            delays.popleft()
        self._drawn[browser] = max(min(float(str(value)), now), self._drawn.get(browser, 0.0))

    def begin(self, browser: int, now: float) -> None:
        """Count the delay of a browser from now on."""
        self._drawn[browser] = now

    def delay(self, browser: int, now: float) -> float:
        """Return the time since the first picture that a browser has not drawn was sent [s]."""
        next_mark = bisect_right(self._marks, self._drawn.get(browser, now))
        return now - self._marks[next_mark] if next_mark < len(self._marks) else 0.0

    def timeout(self, browser: int, least: float) -> float:
        """
        Return the longest valid delay of a browser [s], which is longer for a slow page.

        :param least: timeout of a page that draws fast [s].
        """
        longest = max((delay for _, delay in self._delays.get(browser, ())), default=0.0)
        return max(least, min(TIMEOUT_RATIO * longest, LONGEST_TIMEOUT))

    def keep(self, browsers: Container[int]) -> None:
        """Discard the data of all other browsers."""
        for known in (self._drawn, self._delays):
            for browser in [number for number in known if number not in browsers]:
                del known[browser]
