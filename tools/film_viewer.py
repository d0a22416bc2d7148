# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Film the live view in headless Chromium: drag the object, put it down, and pick it up again.

    python tools/film_viewer.py docs/images/viewer.gif

Frames are taken at equal steps of simulated time, which is slow: a busy machine takes longer.
"""

from __future__ import annotations

import io
from pathlib import Path
import shutil
import sys
import tempfile
import time

from isotruss_ros.demo.processes import keep_to_this_machine, NodeProcess, running_nodes
import numpy as np
from PIL import Image
from playwright.sync_api import Page, sync_playwright, ViewportSize
import rclpy
from rclpy.node import Node
from rosgraph_msgs.msg import Clock

SIZE, SCALE = ViewportSize(width=1080, height=720), 0.65
#: Speed of the simulated clock, since a machine without a graphics card is slow to draw; and of
#: the film.
CLOCK_SPEED, FILM_SPEED = 0.3, 3.0
#: Simulated time between two frames, and longest one until the page shows a text [s].
STEP, PATIENCE = 0.4, 40.0
#: Longest time without a step of the clock, or without a response of the page [s].
TIMEOUT = 120.0
#: Longest time that a frame is shown [s].
LONGEST = 0.5
#: Number of colours of the film, and number of frames that determine them.
COLORS, SOME = 128, 6
#: Script that limits the page to four pictures a second, so that the nodes have enough processor
#: time.
SLOWLY = """
const draw = window.requestAnimationFrame.bind(window);
window.requestAnimationFrame = (show) => setTimeout(() => draw(show), 250);
window.cancelAnimationFrame = clearTimeout;
"""
CLOCK = {'use_sim_time': True}
SHOWN = CLOCK | {'object_diameter': 0.3, 'friction': 0.8}
COMMON = SHOWN | {'command_timeout': 2.0}
NODES = (
    (
        'simulator',
        COMMON
        | {'plant': 'elastic', 'indentation': 0.01, 'rate': 100.0, 'clock_speed': CLOCK_SPEED},
    ),
    ('manipulation', COMMON | {'object_mass': 0.5, 'rate': 50.0}),
    ('grasp_analysis', COMMON | {'rate': 20.0}),
    ('grasp_planner', CLOCK | {'command_timeout': 2.0}),
    ('pick_and_place', COMMON),
    ('viewer', SHOWN | {'port': 0, 'rate': 5.0, 'browser_timeout': 60.0}),
)


class Film:
    """Frames of a page until an event."""

    def __init__(self, processes: list[NodeProcess], page: Page) -> None:
        self._processes, self._page = processes, page
        #: Frames that differ from the one before, and the simulated time of each [s].
        self._frames: list[Image.Image] = []
        self._times: list[float] = []
        self._now = 0.0
        self._node: Node = rclpy.create_node('film')
        self._node.create_subscription(Clock, '/clock', self._receive, 1)

    def take(self) -> Image.Image:
        """Return a frame, one step after the last one."""
        due = self._now + STEP
        while self._now < due:
            before = self._now
            rclpy.spin_once(self._node, timeout_sec=TIMEOUT)
            for process in self._processes:
                process.require_running()
            if self._now == before:
                raise TimeoutError(f'/clock stands still at {before:g} s for {TIMEOUT:g} s')
        frame = Image.open(io.BytesIO(self._page.screenshot(scale='device'))).convert('RGB')
        if not self._frames or frame != self._frames[-1]:
            self._frames.append(frame)
            self._times.append(self._now)
        return frame

    def begin(self) -> Image.Image:
        """Return the first frame of the film that is like the frame after it."""
        frame = self.take()
        while (following := self.take()) != frame:
            frame = following
        self._frames, self._times = [frame], self._times[-1:]
        return frame

    def until(self, words: str) -> None:
        """Film until the page shows a text."""
        end = self._now + PATIENCE
        while not self._page.get_by_text(words).count():
            if self._now > end:
                shown = self._page.locator('body').inner_text()
                raise TimeoutError(f'not within {PATIENCE:g} s: {words!r}; the page: {shown}')
            self.take()
        print(f'{self._now:.1f} s: {words}', flush=True)
        self.take()

    def write(self, path: Path) -> None:
        """Write the film."""
        # Held and not held, loaded and not: the colours of all that is shown.
        some = self._frames[:: max(1, len(self._frames) // SOME)]
        sheet = Image.new('RGB', (some[0].width, some[0].height * len(some)))
        for row, frame in enumerate(some):
            sheet.paste(frame, (0, row * frame.height))
        # By their range, not by their share: few points have the colours that matter.
        common = sheet.quantize(COLORS, Image.Quantize.MAXCOVERAGE)
        first, *others = (frame.quantize(palette=common) for frame in self._frames)
        shown = np.diff(self._times, append=np.inf) / FILM_SPEED
        durations = 1e3 * np.minimum(shown, LONGEST)
        first.save(
            path, save_all=True, append_images=others, duration=durations.round().tolist(), loop=0
        )

    def _receive(self, message: Clock) -> None:
        self._now = message.clock.sec + 1e-9 * message.clock.nanosec


def find_handle(frame: Image.Image) -> tuple[float, float]:
    """Return the position of the blue handle on the page."""
    red, green, blue = np.moveaxis(np.asarray(frame).astype(int), 2, 0)
    found = (blue > red + 80) & (blue > green + 60)
    found[:, int(0.65 * found.shape[1]) :] = False
    rows, columns = np.nonzero(found)
    if not len(rows):
        raise LookupError('the page shows no blue ball')
    return float(columns.mean()) / SCALE, float(rows.mean()) / SCALE


def act(page: Page, film: Film) -> None:
    """Drag the object, put it down, and pick it up."""
    page.get_by_text('slip margin').wait_for()
    page.get_by_label('control', exact=True).evaluate('box => box.click()')
    page.get_by_role('button', name='pick', exact=True).wait_for()
    film.until('at rest')
    x, y = find_handle(film.begin())
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(10):
        page.mouse.move(x - 4.0 * step, y - 3.0 * step)
        film.take()
    page.mouse.up()
    film.until('manipulation: idle')
    for name, words in (('place', 'place: the object is free'), ('pick', 'pick: held')):
        page.get_by_role('button', name=name, exact=True).click()
        film.until(words)


def read_address(viewer: NodeProcess) -> str:
    """Wait until a viewer prints its address, and return the address."""
    while 'viewer: http' not in (words := viewer.log.read_text()):
        viewer.require_running()
        time.sleep(0.2)
    return words.partition('viewer: ')[2].split()[0]


def main() -> None:
    """Write the film."""
    path = Path(sys.argv[1])
    keep_to_this_machine()
    rclpy.init()
    with (
        tempfile.TemporaryDirectory() as logs,
        running_nodes(NODES, Path(logs)) as processes,
        sync_playwright() as playwright,
    ):
        browser = playwright.chromium.launch(
            executable_path=shutil.which('chromium'),
            args=['--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--no-sandbox'],
        )
        page = browser.new_page(viewport=SIZE, device_scale_factor=SCALE)
        page.add_init_script(SLOWLY)
        page.set_default_timeout(1e3 * TIMEOUT)
        page.goto(read_address(processes[-1]))
        page.add_style_tag(content='.mantine-Notification-root { display: none }')
        film = Film(processes, page)
        act(page, film)
        browser.close()
    rclpy.shutdown()
    film.write(path)


if __name__ == '__main__':
    main()
