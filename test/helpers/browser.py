# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A page of the live view in Chromium: its start, its pixels and its controls."""

from __future__ import annotations

import importlib.util
import io
from pathlib import Path
import shutil
import time
from typing import Any

from isotruss_ros.demo.processes import NodeProcess
import numpy as np
from PIL import Image
import pytest

CHROMIUM = shutil.which('chromium')
PACKAGES = all(map(importlib.util.find_spec, ('viser', 'playwright')))
MARKS = [
    pytest.mark.system,
    pytest.mark.xdist_group('browser'),
    pytest.mark.skipif(not PACKAGES, reason='pip install viser playwright'),
    pytest.mark.skipif(CHROMIUM is None, reason='apt-get install chromium'),
    pytest.mark.timeout(900),
]
#: In which everything here comes about, on a machine that is busy and draws without hardware [s].
DEADLINE = 240.0
#: Any port that is free; and a page that draws in software may be slow [s], but no slower than
#: the websocket, which closes after 20 to 40 s without an answer.
SERVED = {'port': 0, 'browser_timeout': 20.0}
VIEWPORT = {'width': 700, 'height': 480}
#: Width of the scene, left of the panels.
SCENE = 370
#: Fewer than the object has, or its handle.
SOME = 80
#: What is drawn in software takes the processors from the nodes.
SLOWLY = """
const draw = window.requestAnimationFrame.bind(window);
window.requestAnimationFrame = (show) => setTimeout(() => draw(show), 250);
window.cancelAnimationFrame = clearTimeout;
"""
#: Of the browser's own client: it is no fault of the page.
HARMLESS = 'Unable to preventDefault inside passive event listener'


def pixels(page: Any) -> np.ndarray:
    """Return the (h, w, 3) colours of the scene, left of the panels."""
    picture = Image.open(io.BytesIO(page.screenshot(scale='css'))).convert('RGB')
    return np.asarray(picture).astype(int)[:, :SCENE]


def blue(colors: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return where the handle is drawn: rows and columns."""
    red, green, last = np.moveaxis(colors, 2, 0)
    return np.nonzero((last > red + 80) & (last > green + 60))


def middle(found: tuple[np.ndarray, ...]) -> tuple[float, ...]:
    return tuple(float(np.mean(part)) for part in found)


def count_green(colors: np.ndarray) -> int:
    """Return how many pixels have the colour of a held object."""
    red, green, last = np.moveaxis(colors, 2, 0)
    return int(((green > red + 50) & (green > last + 40)).sum())


def polite_browser(folder: Path) -> Path:
    """Return a browser that leaves the processors to the nodes: it draws in software."""
    script = folder / 'chromium'
    script.write_text(f'#!/bin/sh\nexec nice -n 10 {CHROMIUM} "$@"\n')
    script.chmod(0o755)
    return script


def launch(playwright: Any, program: Path | str) -> Any:
    return playwright.chromium.launch(
        executable_path=program,
        args=['--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--no-sandbox'],
    )


def open_page(browser: Any, scale: float) -> Any:
    """Return a page that draws at most four times a second, scaled in pixels."""
    page = browser.new_page(viewport=VIEWPORT, device_scale_factor=scale)
    page.add_init_script(SLOWLY)
    page.set_default_timeout(1e3 * DEADLINE)
    return page


def read_address(process: NodeProcess) -> str:
    """Return the address that a viewer prints, once it does."""
    end = time.monotonic() + DEADLINE
    while (line := process.find_line('viewer: http')) is None:
        process.require_running()
        assert time.monotonic() < end, process.log.read_text()
        time.sleep(0.05)
    return line.removeprefix('viewer: ')


def find_switch(page: Any) -> Any:
    """Return the switch of the control; the settings of the browser's client have some as well."""
    return page.get_by_label('control', exact=True)


def switch_control(page: Any) -> None:
    find_switch(page).evaluate('box => box.click()')
