# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The view of a robot in Chromium; by night a session of `SESSION_MINUTES` with two pages."""

import contextlib
import importlib.util
import io
import os
import re
import shutil
import subprocess
import sys
import time

from geometry_msgs.msg import Twist, WrenchStamped
from isotruss_msgs.msg import ManipulationStatus
from isotruss_ros.demo.processes import running_nodes
from isotruss_ros.demo.view import DIAMETER, FRICTION, list_nodes
from mujoco_worlds import needs_mujoco
import numpy as np
from PIL import Image
from probe import world
import psutil
import pytest
from robots import quick_robot

SESSION_MINUTES = float(os.environ.get('SESSION_MINUTES', '10'))
#: Distance of a drag [pixels], in which a metre has about a hundred, and the least motion that
#: answers it [m].
DRAG, ANSWER = 5, 0.01
#: Text of a finished goal, after its stages with their percentage.
RESULT = r'{}: (?!sent|[a-z ]+ \d+ %)(.+)'
CHROMIUM = shutil.which('chromium')
PACKAGES = all(map(importlib.util.find_spec, ('viser', 'playwright')))
pytestmark = [
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


def pixels(page):
    """Return the (h, w, 3) colours of the scene, left of the panels."""
    picture = Image.open(io.BytesIO(page.screenshot(scale='css'))).convert('RGB')
    return np.asarray(picture).astype(int)[:, :SCENE]


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
    script.write_text(f'#!/bin/sh\nexec nice -n 10 {CHROMIUM} "$@"\n')
    script.chmod(0o755)
    return script


def launch(playwright, program):
    return playwright.chromium.launch(
        executable_path=program,
        args=['--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--no-sandbox'],
    )


def open_page(browser, scale):
    """Return a page that draws at most four times a second, scaled in pixels."""
    page = browser.new_page(viewport=VIEWPORT, device_scale_factor=scale)
    page.add_init_script(SLOWLY)
    page.set_default_timeout(1e3 * DEADLINE)
    return page


def read_address(process):
    """Return the address that a viewer prints, once it does."""
    end = time.monotonic() + DEADLINE
    while (line := process.find_line('viewer: http')) is None:
        process.require_running()
        assert time.monotonic() < end, process.log.read_text()
        time.sleep(0.05)
    return line.removeprefix('viewer: ')


def find_switch(page):
    """Return the switch of the control; the settings of the browser's client have some as well."""
    return page.get_by_label('control', exact=True)


class Session:
    """Pages of one view, whose nodes have to run on whatever the pages do."""

    def __init__(self, w, processes, browser):
        self.world, self._processes, self._browser = w, processes, browser
        self._address, self.errors = read_address(processes[-1]), []
        self.log = processes[-1].log
        w.probe.listen(WrenchStamped, 'pull', 'external_wrench')
        w.probe.listen(Twist, 'twist', 'cmd_vel')
        self.until(lambda: w.probe.last('pose') and w.probe.last('status'), 'a pose')
        self._home = w.place()

    def until(self, what, words):
        """Wait until something holds while all nodes run and no control ends by itself."""
        end = time.monotonic() + DEADLINE
        while not what():
            self.world.spin(0.2)
            for process in self._processes:
                process.require_running()
            log = self.log.read_text()
            assert 'control ended' not in log, log
            assert 'error of the viewer' not in log, log
            assert time.monotonic() < end, f'{words}: not within {DEADLINE} s'

    def open_page(self):
        page = open_page(self._browser, 0.5)
        page.on('pageerror', lambda error: self.errors.append(str(error)))
        page.goto(self._address)
        self.begin(page)
        return page

    def begin(self, page):
        """Wait until a page has its controls, and hide the warnings that look like a handle."""
        page.add_style_tag(content='.mantine-Notification-root { display: none }')
        find_switch(page).wait_for(state='attached')

    def take_control(self, page):
        """Switch control on in a page, once no other page has it."""
        self.until(lambda: 'nobody has control' in page.inner_text('body'), 'no control')
        find_switch(page).evaluate('box => box.click()')
        self.until(lambda: len(blue(pixels(page))[0]) > SOME, 'control')

    def grab(self, page, way):
        """Take the handle and move it right and down, by so many pixels each."""
        self.until(lambda: len(blue(pixels(page))[0]) > SOME, 'the handle')
        y, x = (float(np.mean(part)) for part in blue(pixels(page)))
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + way, y + way, steps=DRAG)

    def is_commanded(self):
        """Return whether the last twist moves."""
        return self.world.probe.last('twist') not in (None, Twist())

    def drag(self, page):
        """Drag the object right and down, or left and up if it was, and await its motion."""
        begin = self.world.place()
        sign = 1 if begin[0] <= self._home[0] else -1

        def moved():
            x, y, _ = sign * (self.world.place() - begin)
            return min(x, -y) > ANSWER

        self.grab(page, sign * DRAG)
        page.mouse.up()
        self.until(moved, 'a drag')

    def pull(self, page):
        """Pull at the object by the number beside a slider, and let go."""
        page.get_by_text('external wrench').click()
        row = page.get_by_text('force x [N]').locator('xpath=ancestor::div[.//input][1]')
        for value in (1.0, 0.0):
            row.locator('input').last.fill(f'{value:g}')

            def pulls(value=value):
                message = self.world.probe.last('pull')
                return message is not None and message.wrench.force.x == value

            self.until(pulls, f'a pull of {value} N')
        page.get_by_text('external wrench').click()

    def ask(self, page, name, answer):
        """Click a button until its goal ends with an answer, as a late message may abort one."""
        for _ in range(5):
            page.get_by_role('button', name=name, exact=True).click()
            self.world.spin(1.0)  # until the result of an earlier goal has gone
            texts = []

            def ended(texts=texts):
                texts[:] = re.findall(RESULT.format(name), page.inner_text('body'))
                return bool(texts)

            self.until(ended, f'an end of {name}')
            if re.search(answer, texts[0]):
                return
        raise AssertionError(texts)

    def reload(self, page):
        """Reload the page in control, which gives it up."""
        page.reload()
        self.begin(page)


@contextlib.contextmanager
def session(folder, nodes):
    """Return a session beside nodes, the last of them the viewer, which all end as they should."""
    from playwright.sync_api import sync_playwright

    with running_nodes(nodes, folder) as processes, sync_playwright() as playwright, world() as w:
        browser = launch(playwright, polite_browser(folder))
        made = Session(w, processes, browser)
        yield made
        browser.close()
        assert [error for error in made.errors if HARMLESS not in error] == []
    assert [process.process.returncode for process in processes] == [0] * len(processes)


def test_the_object_follows_its_handle_and_a_stop_ends_it(tmp_path):
    shown = {'robot': quick_robot(), 'object_diameter': 0.3, 'friction': 0.8}
    common = shown | {'command_timeout': 2.0, 'rate': 50.0}
    nodes = [
        ('simulator', common | {'plant': 'elastic', 'indentation': 0.005}),
        ('manipulation', common),
        ('grasp_analysis', {**common, 'rate': 5.0}),
        ('viewer', shown | SERVED | {'rate': 10.0}),
    ]
    with session(tmp_path, nodes) as s:
        page = s.open_page()
        page.get_by_text('slip margin').wait_for()
        s.until(lambda: count_green(pixels(page)) > SOME, 'an object drawn as held')
        # Nothing moves while the control is off: no twist was published.
        assert s.world.code() == ManipulationStatus.HALT_NO_TWIST
        assert len(blue(pixels(page))[0]) < 0.5 * SOME
        s.take_control(page)
        s.drag(page)
        s.until(lambda: s.world.code() == ManipulationStatus.IDLE, 'the end of a drag')
        page.get_by_role('button', name='stop', exact=True).click()
        s.until(lambda: s.world.code() == ManipulationStatus.HALT_EMERGENCY_STOP, 'a stop')
        page.get_by_text('emergency stop').first.wait_for()


@pytest.mark.nightly
@pytest.mark.timeout(60.0 * SESSION_MINUTES + 1200.0)
def test_a_session_ends_neither_a_node_nor_a_control(tmp_path):
    shown = {'object_diameter': DIAMETER, 'friction': FRICTION}
    nodes = [*list_nodes('elastic', shown), ('viewer', shown | SERVED)]
    with session(tmp_path, nodes) as s:
        page, end = s.open_page(), time.monotonic() + 60.0 * SESSION_MINUTES
        while time.monotonic() < end:
            s.take_control(page)
            s.drag(page)
            s.pull(page)
            s.ask(page, 'place', 'the object is free|not held')
            s.ask(page, 'pick', 'held at|already held')
            s.drag(page)
            s.reload(page)
            other = s.open_page()
            s.take_control(other)
            s.drag(other)
            other.close()


def find_processes(word):
    """Return the processes of the browser whose command contains a word."""
    children = psutil.Process().children(recursive=True)
    return [each for each in children if 'chrom' in each.name() and word in each.cmdline()]


@pytest.mark.nightly
@pytest.mark.parametrize('word', ['--no-sandbox', '--type=gpu-process'], ids=['whole', 'drawing'])
def test_a_browser_that_freezes_in_mid_drag_commands_nothing_more(tmp_path, word):
    shown = {'object_diameter': DIAMETER, 'friction': FRICTION}
    # So slow that the drag does not end by itself.
    viewer = ('viewer', shown | SERVED | {'max_speed': 0.002})
    with session(tmp_path, [*list_nodes('elastic', shown), viewer]) as s:
        page = s.open_page()
        s.take_control(page)
        s.grab(page, 50)
        s.until(s.is_commanded, 'a twist')
        frozen = find_processes(word)
        assert frozen
        begin = time.monotonic()
        try:
            for each in frozen:
                each.suspend()
            s.world.until(lambda: not s.is_commanded())
        finally:
            for each in frozen:
                each.resume()
        assert time.monotonic() - begin < 2.0 * SERVED['browser_timeout']
        log = s.log.read_text()
        assert 'has drawn no new picture for' in log
        assert 'drag aborted' not in log
        page.get_by_text('nobody has control').wait_for()
        page.mouse.up()
        assert not find_switch(page).is_checked()


@pytest.mark.nightly
def test_a_page_whose_server_has_ended_says_so_across_the_picture(tmp_path):
    from playwright.sync_api import sync_playwright

    with (
        running_nodes([('viewer', SERVED)], tmp_path) as (viewer,),
        sync_playwright() as playwright,
    ):
        browser = launch(playwright, polite_browser(tmp_path))
        page = open_page(browser, 0.3)
        page.goto(read_address(viewer))
        page.get_by_text('nobody has control').wait_for()
        assert viewer.stop() == 0
        notice = page.get_by_text('No connection: ')
        notice.wait_for()
        box = notice.bounding_box()
        browser.close()
    assert (box['width'], box['height']) == (VIEWPORT['width'], VIEWPORT['height'])


@pytest.mark.nightly
def test_arrow_keys_turn_the_camera_but_not_those_in_a_slider(tmp_path):
    from playwright.sync_api import sync_playwright

    def press(page):
        """Hold a key; return whether most of the drawn pixels are others."""
        before = pixels(page)
        page.keyboard.down('ArrowRight')
        page.wait_for_timeout(2000)
        page.keyboard.up('ArrowRight')
        page.wait_for_timeout(2000)
        return (pixels(page) != before).mean() > 0.05

    with (
        running_nodes([('viewer', SERVED)], tmp_path) as (viewer,),
        sync_playwright() as playwright,
    ):
        browser = launch(playwright, polite_browser(tmp_path))
        page = open_page(browser, 0.3)
        page.goto(read_address(viewer))
        page.get_by_text('nobody has control').wait_for()
        find_switch(page).evaluate('box => box.click()')
        page.get_by_text('assumed by the analysis').dispatch_event('click')
        slider = page.get_by_role('slider').first
        slider.focus()
        begin = slider.get_attribute('aria-valuenow')
        assert not press(page)
        assert slider.get_attribute('aria-valuenow') != begin
        slider.blur()
        assert press(page)
        browser.close()


@pytest.mark.nightly
@needs_mujoco
def test_the_view_of_mujoco_places_the_object():
    command = [sys.executable, '-u', '-m', 'isotruss_ros.demo.view', '--plant', 'mujoco']
    command += ['--port', '0']
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as view:
        try:
            while 'viewer: http' not in (line := view.stdout.readline()):
                assert line, 'the view ended'
            asked = [sys.executable, '-m', 'isotruss_ros.cli.operate', 'place']
            done = subprocess.run(asked, capture_output=True, text=True, timeout=300, check=False)
            assert done.returncode == 0, done
        finally:
            view.terminate()
    assert 'the object is free' in done.stdout
