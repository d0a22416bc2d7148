# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Control by a browser that reloads, freezes or has lost its server, in Chromium."""

import contextlib
import re
import threading
import time

from browser import (
    blue,
    CHROMIUM,
    count_tubes,
    DEADLINE,
    find_switch,
    launch,
    MARKS,
    middle,
    open_page,
    pixels,
    read_address,
    SERVED,
    SOME,
    switch_control,
    VIEWPORT,
)
from geometry_msgs.msg import PoseStamped, Twist
from isotruss_ros.core import Pose
from isotruss_ros.demo.processes import running_nodes
from isotruss_ros.nodes.conversions.messages import to_pose_message
import numpy as np
from probe import begin_context
import psutil
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor

pytestmark = MARKS

#: So slow that no drag arrives during a test [m/s].
SPEED = 0.002


def grab(page, until):
    """Drag the handle to the right, and keep it in hand; return the column of the pointer."""
    until(lambda: len(blue(pixels(page))[0]) > SOME)
    y, x = middle(blue(pixels(page)))
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(10):
        page.mouse.move(x + 10 * step, y)
    return x + 90


class Follower:
    """An object that moves as the twists say, each for 50 ms, or that does not."""

    def __init__(self):
        begin_context()
        self.begin()
        self._node = rclpy.create_node('follower')
        self._poses = self._node.create_publisher(PoseStamped, 'object_pose', 1)
        self._node.create_subscription(Twist, 'cmd_vel', self._follow, 100)
        self._node.create_timer(0.1, self._publish)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._executor.spin)
        self._thread.start()

    def begin(self, moves=True):
        """Forget all twists, and go back to where it began."""
        self._moves, self._center, self.twists = moves, np.zeros(2), []

    def _follow(self, twist):
        self.twists.append((twist.linear.x, twist.linear.y))
        self._center += 0.05 * self._moves * np.array(self.twists[-1])

    def _publish(self):
        message = PoseStamped()
        message.header.stamp = self._node.get_clock().now().to_msg()
        message.header.frame_id = 'truss'
        message.pose = to_pose_message(Pose(*self._center, 0.0))
        self._poses.publish(message)

    def until(self, what):
        """Wait until something holds."""
        end = time.monotonic() + DEADLINE
        while not what():
            assert time.monotonic() < end, f'not within {DEADLINE} s'
            time.sleep(0.2)

    def is_commanded(self):
        """Return whether the last twist moves."""
        return bool(self.twists) and np.any(self.twists[-1])

    def speeds(self):
        """Return those of all twists that move."""
        return [np.hypot(*twist) for twist in self.twists if np.any(twist)]

    def close(self):
        """End the node."""
        self._executor.shutdown()
        self._thread.join()
        self._node.destroy_node()
        rclpy.shutdown()


class View:
    """
    A viewer that runs beside nothing but a follower, and a browser.

    :param log: what the viewer prints.
    """

    def __init__(self, browser, address, follower, log):
        self._browser, self._address = browser, address
        self.follower, self.log = follower, log

    def open_other(self, address):
        """Return a page of another viewer."""
        page = open_page(self._browser, 0.3)
        page.goto(address)
        return page

    def open_pages(self, count):
        """Return pages with their numbers, those before first; none of them has control."""
        pages = [page for context in self._browser.contexts for page in context.pages]
        while len(pages) < count:
            pages.append(open_page(self._browser, 0.3))
            pages[-1].goto(self._address, wait_until='commit')
            find_switch(pages[-1]).wait_for(state='attached')
        # A page that begins to draw is silent for long where the machine is busy.
        self.follower.until(lambda: all(count_tubes(pixels(page)) > SOME for page in pages))
        return [(page, number_of(page)) for page in pages[:count]]


def number_of(page):
    """Return the number by which the viewer knows a page, once nobody has control."""
    told = page.get_by_text(re.compile(r'browser \d+: nobody has control'))
    return int(re.search(r'browser (\d+)', told.text_content())[1])


@pytest.fixture(scope='module')
def opened(shared_domain, tmp_path_factory):
    """Return a view for all tests of this file."""
    from playwright.sync_api import sync_playwright

    folder = tmp_path_factory.mktemp('view')
    viewer = ('viewer', SERVED | {'max_speed': SPEED})
    with running_nodes([viewer], folder) as processes, sync_playwright() as playwright:
        browser = launch(playwright, CHROMIUM)
        with contextlib.closing(Follower()) as follower:
            yield View(browser, read_address(processes[0]), follower, processes[0].log)
        browser.close()


@pytest.fixture
def view(opened):
    """Return the view, which commands nothing, beside an object that moves."""
    opened.follower.until(lambda: not opened.follower.is_commanded())
    opened.follower.begin()
    return opened


@pytest.mark.nightly
def test_a_browser_that_reloads_in_mid_drag_commands_nothing_more(view):
    ((page, number),) = view.open_pages(1)
    drag_and_leave(view, page, page.reload)
    page.mouse.up()
    assert number_of(page) > number
    assert not find_switch(page).is_checked()


def find_processes(word):
    """Return the processes of the browser whose command contains a word."""
    children = psutil.Process().children(recursive=True)
    return [each for each in children if 'chrom' in each.name() and word in each.cmdline()]


@pytest.mark.nightly
@pytest.mark.parametrize('word', ['--no-sandbox', '--type=gpu-process'], ids=['whole', 'drawing'])
def test_a_browser_that_freezes_in_mid_drag_commands_nothing_more(view, word):
    ((page, number),) = view.open_pages(1)
    frozen = find_processes(word)
    assert frozen
    try:
        duration = drag_and_leave(view, page, lambda: [each.suspend() for each in frozen])
        assert f'browser {number} has drawn no new picture for' in view.log.read_text()
        assert duration < 2.0 * SERVED['browser_timeout']
    finally:
        for each in frozen:
            each.resume()
    page.get_by_text(f'browser {number}: nobody has control').wait_for()
    page.mouse.up()
    assert not find_switch(page).is_checked()
    view.follower.begin()
    drag_and_leave(view, page, lambda: switch_control(page))
    page.mouse.up()


@pytest.mark.nightly
def test_the_state_of_the_grasp_stays_in_sight_while_the_wrench_is_set(view):
    ((page, _),) = view.open_pages(1)
    switch_control(page)
    page.get_by_text('external wrench').click()
    moment = page.get_by_text('moment [N m]')
    moment.wait_for()
    moment.scroll_into_view_if_needed()
    box = page.locator('.isotruss-state').bounding_box()
    find_switch(page).click(force=True)
    assert min(box['x'], box['y']) >= 0
    assert box['x'] + box['width'] <= VIEWPORT['width']
    assert box['y'] + box['height'] <= VIEWPORT['height']


def is_near(found, column):
    """Return whether there are pixels, in the mean near a column."""
    return len(found[1]) > SOME and abs(np.mean(found[1]) - column) < 20


def drag_and_leave(view, page, leave):
    """
    Drag in a page and leave it; check that the drag was neither at its end nor given up.

    :return: time from then to the last command [s].
    """
    follower = view.follower
    switch_control(page)
    column = grab(page, follower.until)
    # Until the target has arrived at the viewer, which puts the handle there.
    follower.until(lambda: is_near(blue(pixels(page)), column))
    follower.until(follower.is_commanded)
    leave()
    left = time.monotonic()
    follower.until(lambda: not follower.is_commanded())
    duration = time.monotonic() - left
    assert follower.speeds()[-1] == pytest.approx(SPEED)
    assert 'drag aborted' not in view.log.read_text()
    return duration


@pytest.mark.nightly
def test_a_page_whose_server_has_ended_says_so_across_the_picture(opened, tmp_path):
    with running_nodes([('viewer', SERVED)], tmp_path) as (viewer,):
        page = opened.open_other(read_address(viewer))
        page.get_by_text('nobody has control').wait_for()
        assert viewer.stop() == 0
        notice = page.get_by_text('No connection: ')
        notice.wait_for()
        box = notice.bounding_box()
        page.close()
    assert (box['width'], box['height']) == (VIEWPORT['width'], VIEWPORT['height'])
