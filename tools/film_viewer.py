# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Film a scene of the live view.

    python tools/film_viewer.py viewer docs/images/viewer.gif
    python tools/film_viewer.py obstacles docs/images/obstacles.gif

The scene viewer drags the object, puts it down, and picks it up again. The scene obstacles moves
the object around a post, lets it wait behind a disc that is dragged away, and puts it down.
"""

from __future__ import annotations

import math
from pathlib import Path
import sys

from browser_film import CLOCK_SPEED, Film, make_film, Scene
from geometry_msgs.msg import PoseStamped
from isotruss_msgs.action import MoveObject
from isotruss_ros.core import load_robot, Pose
from isotruss_ros.nodes.conversions.messages import to_pose_message
from isotruss_ros.viewer.camera import FIELD_OF_VIEW, place_camera
from nav_msgs.msg import Path as PathMessage
import numpy as np
from PIL import Image
from playwright.sync_api import FloatRect, Page
from rclpy.action import ActionClient

CLOCK = {'use_sim_time': True}
SHOWN = CLOCK | {'object_diameter': 0.3, 'friction': 0.8}
COMMON = SHOWN | {'command_timeout': 2.0}
#: Parameters of the nodes by name, the last of them the viewer.
NODES: dict[str, dict[str, object]] = {
    'simulator': COMMON
    | {'plant': 'elastic', 'indentation': 0.01, 'rate': 100.0, 'clock_speed': CLOCK_SPEED},
    'manipulation': COMMON | {'object_mass': 0.5, 'rate': 50.0},
    'grasp_analysis': COMMON | {'rate': 20.0},
    'path_follower': COMMON,
    'grasp_planner': CLOCK | {'command_timeout': 2.0},
    'pick_and_place': COMMON,
    'viewer': SHOWN | {'port': 0, 'rate': 5.0, 'browser_timeout': 60.0},
}
#: Obstacles at rest, goal of the object, places of the disc before and after its drag, and
#: position of the object from which on the disc is put in its way [m, rad].
ROOM = (
    '{post: {shape: disc, diameter: 0.063, pose: [0.805, 0.574, 0]}, table: {shape: polygon, '
    'vertices: [[0, 0], [0.25, 0], [0.25, 0.45], [0, 0.45]], pose: [1.5, 0.565, 0.297]}}'
)
GOAL = Pose(1.045, 0.781, 0.615)
BEFORE, AFTER, PASSED = (1.05, 0.63), (1.14, 0.5), 0.885
#: Height of the handle of the disc [m].
HANDLE_HEIGHT = 0.1
#: Speed of the object [m/s], and longest time without progress, in which a person clears the way
#: [s].
SPEED, WAIT = 0.05, 60.0
#: Frames while the object waits [-].
WAITING_FRAMES = 8
#: Further parameters of the nodes in the room with these obstacles.
OTHERS: dict[str, dict[str, object]] = {
    'simulator': {'obstacles': ROOM},
    'manipulation': {'obstacles': ROOM},
    'path_follower': {'obstacles': ROOM, 'progress_timeout': WAIT},
    'grasp_planner': {'obstacles': ROOM},
    'pick_and_place': {'obstacles': ROOM, 'plan': True},
    'viewer': {'obstacles': ROOM},
}


def find_handle(frame: Image.Image) -> tuple[float, float]:
    """Return the position of the blue handle in a frame [pixels]."""
    red, green, blue = np.moveaxis(np.asarray(frame).astype(int), 2, 0)
    found = (blue > red + 80) & (blue > green + 60)
    found[:, int(0.65 * found.shape[1]) :] = False
    rows, columns = np.nonzero(found)
    if not len(rows):
        raise LookupError('the page shows no blue ball')
    return float(columns.mean()), float(rows.mean())


def find_pixel(page: Page, x: float, y: float, height: float = 0.0) -> tuple[float, float]:
    """Return the position on the page of a point above the plane of the robot [m]."""
    box = page.locator('canvas').first.bounding_box()
    assert box is not None
    points = load_robot('nine_member').home.points
    position, target = (np.array(part) for part in place_camera(points, 1.1))
    forward = (target - position) / np.linalg.norm(target - position)
    ray = np.array([x, y, height]) - position
    depth = ray @ forward * math.tan(0.5 * FIELD_OF_VIEW)
    right, up = ray[0] / depth, ray @ np.cross([1.0, 0.0, 0.0], forward) / depth
    half = 0.5 * box['height']
    return box['x'] + 0.5 * box['width'] + half * right, box['y'] + half * (1.0 - up)


def take_control(page: Page, film: Film) -> None:
    """Switch control on, and film until robot and object are at rest."""
    page.get_by_text('slip margin').wait_for()
    page.get_by_label('control', exact=True).evaluate('box => box.click()')
    page.get_by_role('button', name='pick', exact=True).wait_for()
    film.until('at rest')


def press(page: Page, name: str) -> None:
    """Click a button."""
    page.get_by_role('button', name=name, exact=True).click()


def drag_object(page: Page, film: Film) -> None:
    """Drag the object, put it down, and pick it up."""
    take_control(page, film)
    x, y = (part / film.scale for part in find_handle(film.begin()))
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(10):
        page.mouse.move(x - 4.0 * step, y - 3.0 * step)
        film.take()
    page.mouse.up()
    film.until('manipulation: idle')
    for name, words in (('place', 'place: the object is free'), ('pick', 'pick: held')):
        press(page, name)
        film.until(words)


def pass_obstacles(page: Page, film: Film) -> None:
    """Move the object around the post, make it wait for a disc, and put it down."""
    take_control(page, film)
    places: list[float] = []
    film.node.create_subscription(
        PoseStamped, 'object_pose', lambda message: places.append(message.pose.position.x), 1
    )
    client = ActionClient(film.node, MoveObject, 'move_object')
    film.until_true(client.server_is_ready, 'the action is offered')
    film.caption = 'The object goes around a post, along a planned path'
    film.begin()
    goal = MoveObject.Goal(speed=SPEED)
    goal.path = PathMessage(poses=[PoseStamped(pose=to_pose_message(GOAL))])
    accepted = client.send_goal_async(goal)
    press(page, 'add obstacle')
    film.until_true(lambda: places[-1] > PASSED, 'the object is behind the post')
    page.mouse.click(*find_pixel(page, *BEFORE))
    film.until('obstacle placed 1')
    film.caption = 'Somebody puts a disc in its way: the object waits'
    for _ in range(WAITING_FRAMES):
        film.take()
    page.mouse.move(*find_pixel(page, *BEFORE, HANDLE_HEIGHT))
    page.mouse.down()
    film.caption = 'The disc is dragged away: the object goes on'
    for share in np.linspace(0.1, 1.0, 8):
        x, y = (1.0 - share) * np.array(BEFORE) + share * np.array(AFTER)
        page.mouse.move(*find_pixel(page, x, y, HANDLE_HEIGHT))
        film.take()
    page.mouse.up()
    ended = accepted.result().get_result_async()
    film.until_true(ended.done, 'the action has ended')
    if ended.result().result.code != MoveObject.Result.SUCCEEDED:
        raise RuntimeError(ended.result().result.message)
    film.caption = 'It is put down between the post and the table'
    press(page, 'place')
    film.until('place: the object is free')
    for _ in range(WAITING_FRAMES):
        film.take()


SCENES = {
    'viewer': Scene(tuple(NODES.items()), drag_object, 0.65),
    'obstacles': Scene(
        tuple((name, values | OTHERS.get(name, {})) for name, values in NODES.items()),
        pass_obstacles,
        1.4,
        FloatRect(x=205.0, y=60.0, width=440.0, height=340.0),
    ),
}


if __name__ == '__main__':
    make_film(Path(sys.argv[2]), SCENES[sys.argv[1]])
