# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Film the live view in headless Chromium: drag the object, put it down, and pick it up again.

    python tools/film_viewer.py docs/images/viewer.gif
"""

from __future__ import annotations

import io
from pathlib import Path
import shutil
import sys
import tempfile
import time

from isotruss_ros.demo.processes import keep_to_this_machine, running_nodes
import numpy as np
from PIL import Image
from playwright.sync_api import Page, sync_playwright

SIZE, SCALE = {'width': 1000, 'height': 620}, 0.7
#: Speed of the simulated clock, since a machine without a graphics card is slow to draw; of the
#: film; the real time between two frames at least, and that in which all comes about [s].
CLOCK_SPEED, FILM_SPEED = 0.25, 2.0
PACE, PATIENCE = 0.4, 300.0
#: Range of the time that a frame is shown [ms].
DURATIONS = 40.0, 400.0
#: Of the film, and frames by which they are chosen.
COLORS, SOME = 128, 6
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
    ('grasp_analysis', COMMON | {'rate': 10.0}),
    ('grasp_planner', CLOCK | {'command_timeout': 2.0}),
    ('pick_and_place', COMMON),
    ('viewer', SHOWN | {'port': 0, 'rate': 10.0, 'browser_timeout': 60.0}),
)


class Film:
    """
    Frames of a page while something comes about.

    :ivar frames: the film so far.
    :ivar times: when each was taken [s].
    """

    def __init__(self, page: Page) -> None:
        self.frames: list[Image.Image] = []
        self.times: list[float] = []
        self._page = page

    def take(self) -> Image.Image:
        """Add a frame, not at once after the last one, and return it."""
        if self.times:
            time.sleep(max(0.0, self.times[-1] + PACE - time.monotonic()))
        self.times.append(time.monotonic())
        frame = Image.open(io.BytesIO(self._page.screenshot(scale='device'))).convert('RGB')
        self.frames.append(frame)
        return frame

    def until(self, words: str) -> None:
        """Film until the page shows some words."""
        end = time.monotonic() + PATIENCE
        while not self._page.get_by_text(words).count():
            if time.monotonic() > end:
                raise TimeoutError(f'the page does not show {words!r}')
            self.take()
        self.take()

    def write(self, path: Path) -> None:
        """Write the film."""
        # Held and not held, loaded and not: the colours of all that is shown.
        some = self.frames[:: max(1, len(self.frames) // SOME)]
        sheet = Image.new('RGB', (some[0].width, some[0].height * len(some)))
        for row, frame in enumerate(some):
            sheet.paste(frame, (0, row * frame.height))
        # By their range, not by their share: few points have the colours that matter.
        common = sheet.quantize(COLORS, Image.Quantize.MAXCOVERAGE)
        first, *others = (frame.quantize(palette=common) for frame in self.frames)
        shown = np.diff(self.times, append=self.times[-1] + PATIENCE)
        shown = np.clip(1e3 * CLOCK_SPEED / FILM_SPEED * shown, *DURATIONS)
        first.save(
            path, save_all=True, append_images=others, duration=shown.round().tolist(), loop=0
        )


def find_handle(frame: Image.Image) -> tuple[float, float]:
    """Return where the blue ball is on the page."""
    red, green, blue = np.moveaxis(np.asarray(frame).astype(int), 2, 0)
    found = (blue > red + 80) & (blue > green + 60)
    found[:, int(0.65 * found.shape[1]) :] = False
    rows, columns = np.nonzero(found)
    return float(columns.mean()) / SCALE, float(rows.mean()) / SCALE


def act(page: Page, film: Film) -> None:
    """Drag the object, put it down, and pick it up."""
    page.get_by_text('slip margin').wait_for()
    page.locator('input[type=checkbox]').last.evaluate('box => box.click()')
    page.get_by_role('button', name='pick', exact=True).wait_for()
    time.sleep(3.0)
    x, y = find_handle(film.take())
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(10):
        page.mouse.move(x - 4.0 * step, y - 3.0 * step)
        film.take()
    page.mouse.up()
    for _ in range(40):
        film.take()
    for name, words in (('place', 'place: free'), ('pick', 'pick: held')):
        page.get_by_role('button', name=name, exact=True).click()
        film.until(words)


def main() -> None:
    """Write the film."""
    path = Path(sys.argv[1])
    keep_to_this_machine()
    with (
        tempfile.TemporaryDirectory() as logs,
        running_nodes(NODES, Path(logs)) as processes,
        sync_playwright() as playwright,
    ):
        while 'viewer: http' not in (words := processes[-1].log.read_text()):
            processes[-1].require_running()
            time.sleep(0.2)
        browser = playwright.chromium.launch(
            executable_path=shutil.which('chromium'),
            args=['--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--no-sandbox'],
        )
        page = browser.new_page(viewport=SIZE, device_scale_factor=SCALE)
        page.set_default_timeout(1e3 * PATIENCE)
        page.goto(words.partition('viewer: ')[2].split()[0])
        page.add_style_tag(content='.mantine-Notification-root { display: none }')
        film = Film(page)
        act(page, film)
        browser.close()
    film.write(path)


if __name__ == '__main__':
    main()
