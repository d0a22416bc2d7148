# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Films of the live view in headless Chromium.

Frames are taken at equal steps of simulated time, which is slow: a busy machine takes longer.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
import io
from pathlib import Path
import re
import shutil
import tempfile
import time

from isotruss_ros.demo.processes import keep_to_this_machine, NodeProcess, running_nodes
import numpy as np
from PIL import Image, ImageDraw, ImageFont
from playwright.sync_api import FloatRect, Page, sync_playwright, ViewportSize
import rclpy
from rclpy.node import Node
from rosgraph_msgs.msg import Clock

SIZE = ViewportSize(width=1080, height=720)
#: Speed of the simulated clock, since a machine without a graphics card is slow to draw; and of
#: the film.
CLOCK_SPEED, FILM_SPEED = 0.3, 3.0
#: Simulated time between two frames, and longest one until an event [s].
STEP, PATIENCE = 0.4, 60.0
#: Longest time between two frames, or without a response of the page [s].
TIMEOUT = 120.0
#: Longest time that a frame is shown, and time of the first frame with another caption [s].
LONGEST, CAPTION_TIME = 0.5, 2.0
#: Number of colours of the film, and number of frames that determine them.
COLORS, SOME = 128, 6
#: Height of a line of the caption, and size of its letters [pixels].
LINE, LETTERS = 24, (18, 13)
#: Script that limits the page to four pictures a second, so that the nodes have enough processor
#: time.
SLOWLY = """
const draw = window.requestAnimationFrame.bind(window);
window.requestAnimationFrame = (show) => setTimeout(() => draw(show), 250);
window.cancelAnimationFrame = clearTimeout;
"""
#: Lines of the page below the caption, without arrows, which the font lacks.
STATUS = re.compile(r'^(?:manipulation: |held|not held|free)[ -~]*', re.MULTILINE)


@dataclass(frozen=True)
class Scene:
    """
    Content of a film.

    :ivar nodes: name and parameters of the nodes, the last of them the viewer.
    :ivar act: function that commands the page and takes the frames.
    :ivar scale: pixels of a frame per pixel of the page [-].
    :ivar clip: part of the page that is filmed [pixels of the page]; None: all of it.
    """

    nodes: Sequence[tuple[str, Mapping[str, object]]]
    act: Callable[[Page, Film], None]
    scale: float
    clip: FloatRect | None = None


class Film:
    """
    Frames of a page until an event.

    :ivar node: node of the film, whose callbacks are called between frames.
    :ivar scale: pixels of a frame per pixel of the page [-].
    :ivar caption: name of the act, shown below the frames with the status; empty: none.
    """

    def __init__(self, processes: list[NodeProcess], page: Page, scene: Scene) -> None:
        self._processes, self._page, self._clip = processes, page, scene.clip
        self.scale, self.caption, self._shown = scene.scale, '', ''
        #: Frames that differ from the one before, and the simulated time of each [s].
        self._frames: list[Image.Image] = []
        self._times: list[float] = []
        #: Shortest time that each frame is shown [s].
        self._least: list[float] = []
        self._now = 0.0
        self.node: Node = rclpy.create_node('film')
        self.node.create_subscription(Clock, '/clock', self._receive, 1)

    def take(self) -> Image.Image:
        """Return a frame, one step after the last one."""
        due, end = self._now + STEP, time.monotonic() + TIMEOUT
        while self._now < due:
            rclpy.spin_once(self.node, timeout_sec=1.0)
            for process in self._processes:
                process.require_running()
            if time.monotonic() > end:
                raise TimeoutError(f'/clock: {self._now:g} s, not {due:g} s after {TIMEOUT:g} s')
        shot = self._page.screenshot(scale='device', clip=self._clip)
        frame = self._write_caption(Image.open(io.BytesIO(shot)).convert('RGB'))
        if not self._frames or frame != self._frames[-1]:
            self._frames.append(frame)
            self._times.append(self._now)
            self._least.append(CAPTION_TIME if self.caption != self._shown else 0.0)
            self._shown = self.caption
        return frame

    def begin(self) -> Image.Image:
        """Return the first frame of the film that is like the frame after it."""
        frame = self.take()
        while (following := self.take()) != frame:
            frame = following
        self._frames, self._times, self._least = [frame], self._times[-1:], self._least[-1:]
        return frame

    def until(self, words: str) -> None:
        """Film until the page shows a text."""
        self.until_true(lambda: self._page.get_by_text(words).count() > 0, words)

    def until_true(self, happens: Callable[[], bool], words: str) -> None:
        """Film until an event, which words describe."""
        end = self._now + PATIENCE
        while not happens():
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
        durations = 1e3 * np.maximum(np.minimum(shown, LONGEST), self._least)
        first.save(
            path, save_all=True, append_images=others, duration=durations.round().tolist(), loop=0
        )

    def _write_caption(self, frame: Image.Image) -> Image.Image:
        """Return a frame with the caption and the page's status below it."""
        if not self.caption:
            return frame
        status = STATUS.findall(self._page.locator('body').inner_text())
        lines = [self.caption, *status]
        captioned = Image.new('RGB', (frame.width, frame.height + 3 * LINE), 'white')
        captioned.paste(frame)
        draw = ImageDraw.Draw(captioned)
        for row, line in enumerate(lines[:3]):
            font = ImageFont.load_default(LETTERS[min(row, 1)])
            draw.text((8, frame.height + row * LINE), line, 'black', font)
        return captioned

    def _receive(self, message: Clock) -> None:
        self._now = message.clock.sec + 1e-9 * message.clock.nanosec


def read_address(viewer: NodeProcess) -> str:
    """Wait until a viewer prints its address, and return the address."""
    while (line := viewer.find_line('viewer: http')) is None:
        viewer.require_running()
        time.sleep(0.2)
    return line.removeprefix('viewer: ')


def make_film(path: Path, scene: Scene) -> None:
    """Write the film of a scene."""
    keep_to_this_machine()
    rclpy.init()
    with (
        tempfile.TemporaryDirectory() as logs,
        running_nodes(scene.nodes, Path(logs)) as processes,
        sync_playwright() as playwright,
    ):
        browser = playwright.chromium.launch(
            executable_path=shutil.which('chromium'),
            args=['--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--no-sandbox'],
        )
        page = browser.new_page(viewport=SIZE, device_scale_factor=scene.scale)
        page.add_init_script(SLOWLY)
        page.set_default_timeout(1e3 * TIMEOUT)
        page.goto(read_address(processes[-1]))
        page.add_style_tag(content='.mantine-Notification-root { display: none }')
        film = Film(processes, page, scene)
        scene.act(page, film)
        browser.close()
    rclpy.shutdown()
    film.write(path)
