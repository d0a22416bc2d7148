# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The live view in a real browser."""

import importlib.util
import io
import shutil
import time

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.msg import ManipulationStatus
from isotruss_ros.demo.processes import running_nodes
import numpy as np
from PIL import Image
from probe import begin_context
import pytest
import rclpy
from rclpy.qos import qos_profile_sensor_data

CHROMIUM = shutil.which('chromium')
PACKAGES = all(map(importlib.util.find_spec, ('viser', 'playwright')))
pytestmark = [pytest.mark.system, pytest.mark.xdist_group('many nodes')]

#: In which everything here comes about, on a machine that is busy and draws without hardware [s].
DEADLINE = 240.0
#: The server; the next port that is free where this is taken.
PORT = 8431
#: Of the browser's own client: it is no fault of the page.
HARMLESS = 'Unable to preventDefault inside passive event listener'


class Observer:
    """The newest pose and status on the topics."""

    def __init__(self):
        begin_context()
        self._node = rclpy.create_node('observer')
        self.seen = {}
        for kind, topic in (
            (PoseStamped, 'object_pose'),
            (ManipulationStatus, 'manipulation/status'),
        ):
            self._node.create_subscription(
                kind,
                topic,
                lambda message, name=topic: self.seen.update({name: message}),
                qos_profile_sensor_data,
            )

    def until(self, what, each=lambda: None):
        """Spin until something holds."""
        end = time.monotonic() + DEADLINE
        while not what():
            assert time.monotonic() < end, f'not within {DEADLINE} s'
            each()
            for _ in range(50):
                rclpy.spin_once(self._node, timeout_sec=0.01)

    def center(self):
        """Return the measured centre of the object."""
        position = self.seen['object_pose'].pose.position
        return np.array([position.x, position.y])

    def code(self):
        """Return the code of the manipulation."""
        status = self.seen.get('manipulation/status')
        return None if status is None else status.code

    def close(self):
        """End the node."""
        self._node.destroy_node()
        rclpy.shutdown()


def pixels(page, width):
    """Return the (h, w, 3) colours of the scene, left of the panels."""
    picture = Image.open(io.BytesIO(page.screenshot(scale='css'))).convert('RGB')
    return np.asarray(picture).astype(int)[:, :width]


def blue(colors):
    """Return where the handle is drawn: rows and columns."""
    red, green, last = np.moveaxis(colors, 2, 0)
    return np.nonzero((last > red + 80) & (last > green + 60))


def count_green(colors):
    """Return how many pixels have the colour of a held object."""
    red, green, last = np.moveaxis(colors, 2, 0)
    return int(((green > red + 50) & (green > last + 40)).sum())


def polite_browser(folder):
    """Return a browser that leaves the processors to the nodes: it draws in software."""
    script = folder / 'chromium'
    script.write_text(f'#!/bin/sh\nexec nice -n 19 {CHROMIUM} "$@"\n')
    script.chmod(0o755)
    return script


@pytest.mark.skipif(not PACKAGES, reason='pip install viser playwright')
@pytest.mark.skipif(CHROMIUM is None, reason='apt-get install chromium')
@pytest.mark.timeout(900)
def test_the_object_follows_its_handle_and_a_stop_ends_it(tmp_path):
    from playwright.sync_api import sync_playwright

    shown = {'object_diameter': 0.3, 'friction': 0.8}
    common = shown | {'rate': 50.0, 'command_timeout': 2.0}
    nodes = [
        ('simulator', common | {'plant': 'elastic', 'indentation': 0.01}),
        ('manipulation', common),
        ('grasp_analysis', {**common, 'rate': 10.0}),
        ('grasp_planner', {'command_timeout': 2.0}),
        ('pick_and_place', shown | {'command_timeout': 2.0}),
        ('viewer', shown | {'port': PORT}),
    ]
    errors = []
    with running_nodes(nodes, tmp_path) as processes, sync_playwright() as playwright:
        observer = Observer()
        log = processes[-1].log
        observer.until(
            lambda: 'viewer: http' in log.read_text() and 'object_pose' in observer.seen
        )
        address = log.read_text().partition('viewer: ')[2].split()[0]
        assert address.startswith('http://127.0.0.1:')
        browser = playwright.chromium.launch(
            executable_path=polite_browser(tmp_path),
            args=['--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--no-sandbox'],
        )
        # A quarter of the pixels: what draws in software takes the processors from the nodes.
        page = browser.new_page(viewport={'width': 900, 'height': 800}, device_scale_factor=0.5)
        page.set_default_timeout(1e3 * DEADLINE)
        page.on('pageerror', lambda error: errors.append(str(error)))
        page.on('console', lambda m: errors.append(m.text) if m.type == 'error' else None)
        page.goto(address)
        page.get_by_text('slip margin').wait_for()
        observer.until(lambda: count_green(pixels(page, 560)) > 1000)

        # Nothing moves while the control is off: no twist was published.
        assert observer.code() == ManipulationStatus.HALT_NO_TWIST
        assert len(blue(pixels(page, 560))[0]) < 50
        page.locator('input[type=checkbox]').last.evaluate('box => box.click()')
        observer.until(lambda: len(blue(pixels(page, 560))[0]) > 100)
        y, x = (float(np.mean(part)) for part in blue(pixels(page, 560)))
        before = observer.center()
        page.mouse.move(x, y)
        page.mouse.down()
        for step in range(10):
            page.mouse.move(x + 3 * step, y + 2 * step)
        page.mouse.up()
        observer.until(
            lambda: (
                observer.code() == ManipulationStatus.IDLE
                and np.linalg.norm(observer.center() - before) > 0.02
            )
        )
        moved = observer.center() - before
        assert moved[0] > 0.0 > moved[1]

        # The object is let go, and picked up again.
        for name, words in (('place', 'free, '), ('pick', 'held at ')):
            page.get_by_role('button', name=name, exact=True).click()
            page.get_by_text(f'{name}: {words}').wait_for()
            held = name == 'pick'
            observer.until(lambda held=held: (count_green(pixels(page, 560)) > 1000) == held)

        page.get_by_role('button', name='stop', exact=True).click()
        observer.until(lambda: observer.code() == ManipulationStatus.HALT_EMERGENCY_STOP)
        page.get_by_text('emergency stop').first.wait_for()
        browser.close()
        observer.close()
    assert [error for error in errors if HARMLESS not in error] == []
