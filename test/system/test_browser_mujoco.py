# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The live view in a real browser, on the plant mujoco: handles, sliders, menu and buttons."""

import time

from browser import (
    blue,
    count_green,
    DEADLINE,
    launch,
    MARKS,
    middle,
    open_page,
    orange,
    pixels,
    polite_browser,
    read_address,
    SERVED,
    SOME,
    switch_control,
)
from geometry_msgs.msg import WrenchStamped
from isotruss_msgs.msg import ManipulationStatus
from isotruss_ros.demo.processes import running_nodes
from lifecycle_msgs.msg import TransitionEvent
import numpy as np
from probe import world
import pytest
from robots import quick_robot

pytest.importorskip('mujoco')
pytestmark = [*MARKS, pytest.mark.nightly]

#: The simulated clock is slower on a machine that is busy.
CLOCK = {'use_sim_time': True}
PATIENT = CLOCK | {'command_timeout': 5.0}
VIEWER = CLOCK | SERVED | {'rate': 10.0, 'browser_timeout': 60.0}


class Session:
    """
    A page in control, beside the nodes.

    :ivar w: hears the nodes.
    """

    def __init__(self, page, w, processes):
        self.page, self.w, self._processes = page, w, processes
        w.probe.listen(TransitionEvent, 'transition', 'simulator/transition_event')

    def until(self, what):
        """Wait until something holds; fail with what the page says, or where a node ended."""
        end = time.monotonic() + DEADLINE
        while not what():  # which takes long: much is heard meanwhile
            for process in self._processes:
                process.require_running()
            assert time.monotonic() < end, self.page.locator('body').inner_text()
            self.w.spin(0.2)

    def press(self, name):
        """Click a button."""
        self.page.get_by_role('button', name=name, exact=True).click()

    def slide(self, number, key, times=1):
        """Press a key on a slider, counted from the top."""
        thumb = self.page.get_by_role('slider').nth(number)
        for _ in range(times):
            thumb.press(key)

    def choose_object(self, name):
        """Choose from the menu of objects."""
        self.page.get_by_label('object', exact=True).click()
        self.page.get_by_role('option', name=name, exact=True).click()

    def begin_anew(self, act):
        """Do what has the simulator configured anew; wait until the page shows a held object."""
        heard = self.w.probe.seen
        heard['transition'].clear()
        act()
        self.until(lambda: any(m.goal_state.label == 'active' for _, m in heard['transition']))
        heard['pose'].clear()
        self.until(self.shows_held_object)

    def shows_held_object(self):
        """Return whether the page shows the object where it was last measured, and held."""
        if (pose := self.w.place()) is None:
            return False
        place = f'object at ({pose[0]:.3f}, {pose[1]:.3f}) m'
        return self.page.get_by_text(place).count() and count_green(pixels(self.page)) > SOME

    def drag(self, color, step_x, step_y):
        """Drag the handle of a colour by ten steps [px]."""
        self.until(lambda: len(color(pixels(self.page))[0]) > SOME)
        y, x = middle(color(pixels(self.page)))
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        for step in range(10):
            self.page.mouse.move(x + step_x * step, y + step_y * step)
        self.page.mouse.up()

    def is_idle(self):
        """Return whether the last drag is at its end."""
        return self.w.code() == ManipulationStatus.IDLE


@pytest.fixture(scope='module')
def opened(shared_domain, tmp_path_factory):
    """Return a session for all tests of this file."""
    from playwright.sync_api import sync_playwright

    folder = tmp_path_factory.mktemp('mujoco')
    shown = {'robot': quick_robot(), 'object_diameter': 0.3, 'friction': 0.8}
    common = shown | PATIENT | {'rate': 50.0}
    plant = {'plant': 'mujoco', 'indentation': 0.01, 'ground_friction': 0.5, 'clock_speed': 1.0}
    nodes = [
        ('simulator', common | plant | {'rate': 100.0}),  # steps as fine as stamps may differ
        ('manipulation', common | {'object_mass': 0.5}),
        ('grasp_analysis', {**common, 'rate': 10.0}),
        ('grasp_planner', {'robot': quick_robot()} | PATIENT),
        ('pick_and_place', shown | PATIENT),
        ('viewer', shown | VIEWER),
    ]
    with running_nodes(nodes, folder) as processes, sync_playwright() as playwright, world() as w:
        browser = launch(playwright, polite_browser(folder))
        page = open_page(browser, 0.5)
        page.goto(read_address(processes[-1]))
        page.add_style_tag(content='.mantine-Notification-root { display: none }')
        session = Session(page, w, processes)
        session.until(lambda: w.probe.last('pose') and w.probe.last('status'))
        page.get_by_text('slip margin').wait_for()
        switch_control(page)
        page.get_by_text('this one has control').wait_for()
        page.get_by_text('assumed by the analysis').click()
        page.get_by_text('external wrench').click()
        yield session
        browser.close()


@pytest.fixture
def session(opened):
    """Return the session, after a reset: the robot at home, the disc held."""
    opened.begin_anew(lambda: opened.press('reset'))
    return opened


def test_the_object_follows_its_handle(session):
    before = session.w.place()
    session.drag(blue, 2, 1)
    session.until(lambda: session.is_idle() and np.hypot(*(session.w.place() - before)[:2]) > 0.02)
    moved = session.w.place() - before
    assert moved[0] > 0.0 > moved[1]


def test_the_object_turns_with_the_other_handle(session):
    before = session.w.place()
    session.drag(orange, 0, -1)
    session.until(lambda: session.is_idle() and session.w.place()[2] - before[2] > 0.1)


def test_an_object_is_placed_and_picked_up(session):
    session.press('place')
    session.page.get_by_text('place: free, ').wait_for()
    session.press('pick')
    session.page.get_by_text('pick: held at ').wait_for()


def test_the_analysis_takes_the_friction_of_its_slider(session):
    session.slide(0, 'Home')
    session.page.get_by_text('not held', exact=True).wait_for()
    session.slide(0, 'ArrowRight', times=15)
    session.page.get_by_text('slip margin').wait_for()


def test_a_force_pulls_at_the_object_by_its_slider(session):
    session.w.probe.listen(WrenchStamped, 'pull', 'external_wrench')
    session.slide(3, 'ArrowRight', times=2)
    session.until(lambda: (pull := session.w.probe.last('pull')) and pull.wrench.force.x == 1.0)
    session.slide(3, 'ArrowLeft', times=2)


@pytest.mark.parametrize('kind', ['box', 'ellipse', 'disc'])
def test_an_object_of_the_menu_is_held_and_follows_its_handle(session, kind):
    session.begin_anew(lambda: session.choose_object(kind))
    session.page.get_by_text(f'object {kind}: active').wait_for()
    before = session.w.place()
    session.drag(blue, 2, 1)
    session.until(lambda: session.is_idle() and np.hypot(*(session.w.place() - before)[:2]) > 0.01)
