# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node `viewer`, with a browser that can send any message."""

import contextlib
from functools import partial
import io
import itertools

from geometry_msgs.msg import Point, Twist, WrenchStamped
from isotruss_msgs.msg import ManipulationStatus, Obstacles
import numpy as np
from probe import CENTER, N, overrides, ROBOT, world
import pytest
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker, MarkerArray

pytest.importorskip('viser')
from fake_browser import FakeBrowser  # noqa: E402,I100
from isotruss_ros.core import ConvexObject, Disc, Obstacle  # noqa: E402
from isotruss_ros.nodes.conversions.obstacle_messages import (  # noqa: E402,I100
    read_obstacles,
    to_obstacles_message,
)
from isotruss_ros.nodes.viewer.node import Viewer  # noqa: E402
from isotruss_ros.viewer import drag  # noqa: E402

LEVER = drag.LEVER_LENGTH


@contextlib.contextmanager
def viewed(**values):
    """Bring up a viewer; yield the world, the node, and a browser that has control."""
    served = {'port': 0, 'browser_timeout': 60.0}
    with world(lambda: Viewer(overrides(**served, **values))) as w:
        node = w.nodes[1]
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            node.begin()
        browser = FakeBrowser(printed.getvalue().removeprefix('viewer: ').strip())
        w.probe.listen(Twist, 'twist', 'cmd_vel')
        w.probe.listen(WrenchStamped, 'pull', 'external_wrench')
        w.statuses = w.probe.create_publisher(ManipulationStatus, 'manipulation/status', 1)
        w.markers = w.probe.create_publisher(MarkerArray, 'grasp/markers', 1)
        w.until(lambda: 'control' in browser.controls)
        browser.set('control', True)
        w.until(lambda: 'force y [N]' in browser.controls)
        try:
            yield w, node, browser
        finally:
            browser.close()
            node.stop()


def moves(w):
    twist = w.probe.last('twist')
    return twist is not None and twist != Twist()


def pulls(w):
    """Return whether the last external wrench is a force of 5 N along x."""
    pull = w.probe.last('pull')
    return pull is not None and pull.wrench.force.x == 5.0


@pytest.mark.parametrize(
    ('handle', 'grabbed', 'pointer', 'twist', 'left'),
    [
        ('turner', (LEVER, 0.0), (0.0, LEVER), (0.0, 0.2), '90° left'),
        ('handle', (0.0, 0.0), (0.1, 0.0), (0.07, 0.0), '100 mm left'),
    ],
)
def test_a_drag_is_commanded_at_its_largest_speed_until_it_is_aborted_with_the_way_left(
    monkeypatch, handle, grabbed, pointer, twist, left
):
    center = tuple(map(float, CENTER))
    there = pytest.approx(center)
    with viewed(max_speed=0.07) as (w, node, browser):
        w.until(
            lambda: browser.scene.get('/handle', {}).get('position', (0.0, 0.0))[:2] == there,
            w.probe.send_pose,
        )
        start, end = (np.add(center, place).tolist() for place in (grabbed, pointer))
        browser.drag(handle, 'start', *end, start)
        w.until(lambda: moves(w), w.probe.send_pose)
        sent = w.probe.last('twist')
        assert (sent.linear.x, sent.angular.z) == pytest.approx(twist)
        assert sent.linear.y == pytest.approx(0.0, abs=1e-6)
        monkeypatch.setattr(drag, 'PROGRESS_TIME', 0.1)
        w.until(lambda: 'aborted' in node.picture.goal_report, w.probe.send_pose)
        assert f'object: no progress for 2 s, {left}' in node.picture.goal_report


def test_requests_of_a_browser_set_parameters_and_release_the_stop():
    asked = set()

    def answer(name, request, response):
        values = [part.value for part in request.parameters]
        asked.add((name, *(part.string_value or part.double_value for part in values)))
        response.results = [SetParametersResult(successful=True) for _ in values]
        return response

    with viewed() as (w, _, browser):
        w.probe.listen(Bool, 'stop', 'emergency_stop')
        for name in ('manipulation', 'path_follower'):
            w.probe.create_service(SetParameters, f'{name}/set_parameters', partial(answer, name))
        parts = itertools.cycle(('P', 'Q', 'object'))
        modes = {
            ('manipulation', *mode) for mode in (('P', 'joint'), ('Q', 'joint'), (0.0, 'object'))
        }
        w.until(lambda: asked >= modes, lambda: browser.set('drag', next(parts)), 0.1)
        browser.set('squeeze [N]', 12.0)
        browser.set('friction', 0.7)
        set_values = {(name, 0.7) for name in ('manipulation', 'path_follower')}
        set_values.add(('manipulation', 12.0))
        w.until(lambda: asked >= set_values)
        assert asked == modes | set_values
        browser.set('release the stop', True)
        w.until(lambda: w.probe.last('stop') == Bool(data=False))


@pytest.mark.parametrize('is_in_status', [True, False], ids=['status', 'topic'])
def test_a_drag_moves_nothing_from_a_stop_to_its_release(is_in_status):
    with viewed() as (w, _, browser):

        def send(stopped):
            w.probe.send_pose()
            if is_in_status:
                status = ManipulationStatus.HALT_EMERGENCY_STOP if stopped else 0
                w.statuses.publish(ManipulationStatus(code=status))
            else:
                w.probe.stops.publish(Bool(data=stopped))

        browser.drag('handle', 'start', 0.5, 0.5)
        w.until(lambda: moves(w), lambda: send(False))
        w.until(lambda: w.probe.last('twist') == Twist(), lambda: send(True))
        count = len(w.probe.seen['twist'])
        browser.drag('handle', 'start', 0.6, 0.5)
        browser.set('force x [N]', 5.0)  # taken after the drag
        w.until(lambda: pulls(w), lambda: send(True))
        assert w.probe.last('pull').header.frame_id == 'truss_object_aligned'
        assert len(w.probe.seen['twist']) == count
        grab = partial(browser.drag, 'handle', 'start', 0.6, 0.5)
        w.until(lambda: moves(w), lambda: (send(False), grab()), 0.1)


def test_a_viewer_goes_on_after_messages_that_cannot_be_shown():
    with viewed() as (w, node, _):
        cut = Marker(ns='contact_regions', points=[Point()] * 7)
        travel = [0.01] * N

        def send():
            w.probe.joint_states.publish(JointState(name=list(ROBOT.roller_names)))
            w.markers.publish(MarkerArray(markers=[cut]))

        w.spin(0.5, send)
        w.until(
            lambda: node.picture.config.roller_positions[0] == pytest.approx(0.01),
            lambda: w.probe.send_joints(position=travel),
        )


class BrokenShape(Disc):
    """Shape of a user, whose outline cannot be computed."""

    def outline(self, spacing):
        raise ZeroDivisionError('the outline of a user')


def spin_as_run(spin_once, node, timeout_sec):
    """Spin once as `run` does."""
    try:
        spin_once(timeout_sec=timeout_sec)
    except ZeroDivisionError as error:
        node.fail(error)


def test_an_error_of_drawing_ends_the_drag_but_neither_the_stop_button_nor_obstacles():
    with viewed() as (w, node, browser):
        w.executor.spin_once = partial(spin_as_run, w.executor.spin_once, node)
        w.probe.listen(Bool, 'stop', 'emergency_stop')
        place_obstacle(w, browser)
        browser.drag('handle', 'start', 0.5, 0.5)
        w.until(lambda: moves(w), w.probe.send_pose)
        node.picture.shape = BrokenShape(0.15)
        w.until(lambda: w.probe.last('twist') == Twist(), w.probe.send_pose)
        w.until(lambda: browser.shows('ZeroDivisionError: the outline of a user'))
        count = count_obstacles(w)
        w.until(lambda: count_obstacles(w) > count + 1)
        browser.set('stop', True)
        w.until(lambda: w.probe.last('stop') == Bool(data=True))
        node.picture.shape = None
        w.until(lambda: not browser.shows('error of the viewer:'))
        assert node.picture.goal_report == ''


def place_obstacle(w, browser):
    """Place an obstacle at (1, 2) by the button and a click, and await its message."""
    w.probe.listen(Obstacles, 'obstacles', 'obstacles')
    browser.set('add obstacle', True)
    w.until(lambda: browser.is_clickable)
    browser.click(1.0, 2.0)
    w.until(lambda: w.probe.last('obstacles'))


def count_obstacles(w):
    return len(w.probe.seen['obstacles'])


def test_a_placed_obstacle_is_published_without_control_until_it_is_cleared():
    def clear(_, response):
        response.success = True
        return response

    with viewed() as (w, node, browser):
        w.probe.create_service(Trigger, 'clear_obstacles', clear)
        place_obstacle(w, browser)
        (obstacle,) = read_obstacles(w.probe.last('obstacles'))
        assert obstacle.body.pose == pytest.approx((1.0, 2.0, 0.0))
        w.until(lambda: node.picture.room.list_obstacles(0.0))
        browser.set('control', False)
        w.until(lambda: browser.shows('nobody has control'))
        count = count_obstacles(w)
        w.until(lambda: count_obstacles(w) > count + 1)
        browser.set('control', True)
        w.until(lambda: browser.shows('this one has control'))
        clears = partial(browser.set, 'clear obstacles', True)
        w.until(lambda: not node.picture.room.list_obstacles(0.0), clears, 1.0)
        count = count_obstacles(w)
        w.spin(0.2)
        assert count_obstacles(w) == count


def test_obstacles_of_file_and_topic_are_shown_and_invalid_ones_are_not():
    wall = '{wall: {shape: half_plane, pose: [0, -1, 1.5708]}}'
    with viewed(obstacles=wall) as (w, node, _):
        sender = w.probe.create_publisher(Obstacles, 'obstacles', 10)
        hand, cart = (Obstacle(name, ConvexObject(Disc(0.1))) for name in ('hand', 'cart'))

        def send():
            now = w.probe.past(0.0)
            for obstacles in ([hand], [cart, cart], [cart]):
                sender.publish(to_obstacles_message(obstacles, now, 'truss'))

        w.until(lambda: len(node.picture.room.list_obstacles(0.0)) > 2, send)
        shown = [obstacle.name for obstacle, _ in node.picture.room.list_obstacles(0.0)]
        assert shown == ['wall', 'hand', 'cart']
