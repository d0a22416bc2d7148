# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Obstacles of the nodes: file, topic, silence, service, markers and planned paths."""

from concurrent.futures import ThreadPoolExecutor, wait
import contextlib

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.action import FollowObjectPath, MoveObject
from isotruss_msgs.msg import GraspState, Obstacles
from isotruss_ros.core import (
    ConvexObject,
    Disc,
    Ellipse,
    Obstacle,
    Polygon,
    Pose,
    Status,
    tangent_center,
)
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.nodes.conversions.messages import read_pose, to_pose_message
from isotruss_ros.nodes.conversions.obstacle_messages import to_obstacles_message
from isotruss_ros.nodes.pick_and_place import action_steps
from isotruss_ros.nodes.pick_and_place.node import PickAndPlace
from manual_actions import MotionClient, replace_clients
from manual_world import check_refused, world
from nav_msgs.msg import Path
import numpy as np
from probe import CENTER, DIAMETER, maker, MODULE, ROBOT
from probe import manipulation as node
import pytest
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker, MarkerArray

#: Gap between the object and an obstacle in the way of the twists of the probe [m].
GAP = 0.021
ABOVE = CENTER[0], CENTER[1] + 0.5 * DIAMETER + 0.05 + GAP, 0.0
POST = f'{{post: {{shape: disc, diameter: 0.1, pose: {list(map(float, ABOVE))}}}}}'
START = tangent_center(ROBOT.home, MODULE, DIAMETER, 0.02)
#: Function of thread pools that a manual world replaces.
SUBMIT = ThreadPoolExecutor.submit


def publisher(w):
    """Return a function that publishes moving obstacles, and the inputs of the node."""
    sender = w.probe.create_publisher(Obstacles, 'obstacles', 10)

    def send(*obstacles):
        w.probe.send_all()
        if obstacles:
            sender.publish(to_obstacles_message(obstacles, w.probe.past(0.0), 'truss'))

    return send


def test_obstacle_of_the_parameter_slows_the_object_with_its_name():
    with world(node(obstacles=POST, slide_along_limits=False)) as w:
        status = w.until_code(Status.SLOWED_OBSTACLE, w.probe.send_all)
    assert 'the object and obstacle post' in status.message


def test_moving_obstacle_of_the_topic_slows_the_object_with_its_name():
    with world(node(slide_along_limits=False)) as w:
        send = publisher(w)
        w.until_code(Status.OK, send)
        hand = Obstacle('hand', ConvexObject(Disc(0.1), ABOVE))
        status = w.until_code(Status.SLOWED_OBSTACLE, lambda: send(hand))
    assert 'the object and obstacle hand' in status.message


def test_silent_obstacle_stops_the_rollers_until_it_is_cleared():
    with world(node(obstacle_timeout=0.3)) as w:
        send = publisher(w)
        far = (CENTER[0] + 5.0, CENTER[1], 0.0)
        hand, cart = (Obstacle(name, ConvexObject(Disc(0.1), far)) for name in ('hand', 'cart'))
        w.spin(0.3, lambda: send(hand, cart))
        assert w.code() == Status.OK
        # The message goes on without the hand.
        status = w.until_code(Status.HALT_STALE_OBSTACLES, lambda: send(cart))
        assert 'moving obstacle hand' in status.message
        answer = w.call('clear_obstacles', Trigger.Request())
        assert answer.success
        assert 'hand' in answer.message
        w.until_code(Status.OK, lambda: send(cart))


def test_invalid_first_message_of_obstacles_stops_the_rollers_with_the_reason():
    with world(node()) as w:
        sender = w.probe.create_publisher(Obstacles, 'obstacles', 10)
        hand = Obstacle('hand', ConvexObject(Disc(0.1), ABOVE))

        def send():
            w.probe.send_all()
            message = to_obstacles_message([hand, hand], w.probe.past(0.0), 'truss')
            sender.publish(message)

        status = w.until_code(Status.HALT_INVALID_OBSTACLES, send)
    assert "'hand': named twice" in status.message


@pytest.mark.parametrize('text', ['{post: {shape: disc, diameter: 0.1}}', '/no/such/file.yaml'])
def test_invalid_obstacles_of_the_parameter_are_refused(text):
    check_refused(node(obstacles=text), "key 'pose'|cannot be read")


def test_markers_show_the_obstacles_at_rest_and_the_moving_ones():
    box = Polygon(((-0.1, -0.05), (0.1, -0.05), (0.1, 0.05), (-0.1, 0.05)))
    moving = [
        Obstacle('hand', ConvexObject(Ellipse((0.1, 0.2)), (5.0, 1.0, 0.5))),
        Obstacle('cart', ConvexObject(box, (6.0, 1.0, 0.5))),
    ]
    with world(node(obstacles=POST)) as w:
        w.probe.listen(MarkerArray, 'markers', 'obstacle_markers')
        send = publisher(w)

        def shown():
            first, *others = w.probe.last('markers').markers
            assert first.action == Marker.DELETEALL
            return {marker.ns: marker for marker in others}

        w.until(lambda: w.probe.last('markers') and len(shown()) == 3, lambda: send(*moving))
    markers = shown()
    assert read_pose('pose', markers['post'].pose) == pytest.approx(ABOVE)
    assert markers['post'].scale.x == markers['post'].scale.y == 0.1
    assert read_pose('pose', markers['hand'].pose) == pytest.approx((5.0, 1.0, 0.5))
    assert (markers['hand'].type, markers['hand'].scale.x) == (Marker.CYLINDER, 0.2)
    assert markers['hand'].scale.y == 0.4
    corners = np.array([(point.x, point.y) for point in markers['cart'].points])
    assert np.abs(corners).max(axis=0) == pytest.approx((0.1, 0.05))


@contextlib.contextmanager
def moving_object(patch, goal, *published, **parameters):
    """Yield a world with a goal of `move_object`, the client of the path, and its inputs."""
    reached = FollowObjectPath.Result(code=FollowObjectPath.Result.REACHED)
    client = MotionClient(reached)
    replace_clients(patch, action_steps, lambda *_: client)
    settings = {'command_timeout': 1.0, 'friction': 0.8, 'plan': True} | parameters
    with world(maker(PickAndPlace, **settings)()) as w:
        w.probe.listen(Path, 'path', 'planned_path')
        sender = w.probe.create_publisher(Obstacles, 'obstacles', 10)

        def send():
            sender.publish(to_obstacles_message(published, w.probe.past(0.0), 'truss'))
            w.probe.send_joints()
            w.probe.send_object((*START, 0.0))
            w.probe.send_held(GraspState.HELD_YES, members_at(ROBOT, MODULE))

        w.spin(0.1, send)
        target = PoseStamped(pose=to_pose_message(Pose(*goal)))
        yield w, w.send_goal(MoveObject.Goal(path=Path(poses=[target]))), client, send


def move(patch, goal, *published, **parameters):
    """Return the result of a motion to a pose, the followed path, and the published path."""
    with moving_object(patch, goal, *published, **parameters) as (w, request, client, send):
        return w.finish(request, send)[1], client.goal, w.probe.last('path')


def test_search_for_a_path_reports_its_progress_and_ends_when_cancelled(monkeypatch):
    places = {'left': (-0.2, -0.2), 'middle': (0.0, -0.27), 'right': (0.2, -0.2)}
    posts = ', '.join(
        f'{name}: {{shape: disc, diameter: 0.1, pose: [{START[0] + x}, {START[1] + y}, 0]}}'
        for name, (x, y) in places.items()
    )
    goal, searches = (START[0], START[1] - 0.55, 0.0), []

    def submit(pool, search):
        searches.append(SUBMIT(pool, search))
        return searches[-1]

    with moving_object(monkeypatch, goal, obstacles=f'{{{posts}}}') as (w, request, _, send):

        def give_time():
            send()
            wait(searches, 0.05)

        def planning():
            stages = (part for part in request.feedback if part.stage == part.PLANNING)
            return any(part.progress > 0.0 for part in stages)

        with monkeypatch.context() as patch:
            patch.setattr(ThreadPoolExecutor, 'submit', submit)
            w.until(planning, give_time)
            assert request.cancel()
            result = w.finish(request, give_time)[1]
    assert result.code == MoveObject.Result.CANCELLED
    assert '(stopped)' in searches[0].result().why


def test_motion_to_one_pose_follows_the_planned_path(monkeypatch):
    goal = START[0] + 0.04, START[1] - 0.02, 0.1
    result, asked, shown = move(monkeypatch, goal)
    assert result.code == MoveObject.Result.SUCCEEDED, result.message
    poses = [read_pose('pose', stamped.pose) for stamped in asked.path.poses]
    assert poses[0] == pytest.approx((*START, 0.0), abs=5e-3)
    assert poses[-1] == pytest.approx(goal, abs=1e-6)
    assert shown == asked.path


@pytest.mark.parametrize('is_published', [False, True])
def test_motion_to_a_pose_within_an_obstacle_is_refused_with_its_name(monkeypatch, is_published):
    place, goal = (START[0], START[1] - 0.4, 0.0), (START[0], START[1] - 0.3, 0.0)
    if is_published:
        result, asked, _ = move(
            monkeypatch, goal, Obstacle('post', ConvexObject(Disc(0.1), place))
        )
    else:
        post = f'{{post: {{shape: disc, diameter: 0.1, pose: {list(map(float, place))}}}}}'
        result, asked, _ = move(monkeypatch, goal, obstacles=post)
    assert result.code == MoveObject.Result.STOPPED
    assert 'no way found' in result.message
    assert 'obstacle post' in result.message
    assert asked is None
