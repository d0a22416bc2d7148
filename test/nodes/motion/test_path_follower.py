# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The path follower, with nodes or a world that misbehaves; obstacles of the nodes."""

from concurrent.futures import Future, ThreadPoolExecutor, wait
import contextlib
import itertools
import math
import re

from action_msgs.msg import GoalInfo, GoalStatus
from geometry_msgs.msg import PoseStamped, Quaternion, Twist
from held_grips import AROUND
from isotruss_msgs.action import FollowObjectPath, MoveObject
from isotruss_msgs.msg import GraspState, ManipulationStatus, Obstacles
from isotruss_ros import core
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.nodes.conversions.messages import make_header, read_pose, to_pose_message
from isotruss_ros.nodes.conversions.obstacle_messages import to_obstacles_message
from isotruss_ros.nodes.conversions.path_messages import read_object_path
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.path_follower import PathFollower
from isotruss_ros.nodes.pick_and_place import action_steps
from isotruss_ros.nodes.pick_and_place.node import PickAndPlace
from isotruss_ros.nodes.simulator.node import Simulator
from lifecycle_msgs.msg import Transition
from manual_actions import MotionClient, replace_clients
from manual_world import check_refused, Manager, world
from nav_msgs.msg import Path
from nightly import some_now
import numpy as np
from probe import CENTER, DIAMETER, maker, manipulation, MODULE, overrides, ROBOT
import pytest
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker, MarkerArray

Result = FollowObjectPath.Result
STOPPED = (GoalStatus.STATUS_ABORTED, Result.STOPPED)
#: In the grip at home, as the simulator puts it, and as the probe puts it.
HOME = (*CENTER, 0.0)
PROBED = (*CENTER, 0.3)
ERROR = 'position error [m]'
PATIENT = {'command_timeout': 5.0, 'rate': 50.0}
ROBOT_SETTINGS = {'command_timeout': 0.5, 'rate': 25.0}
node = maker(PathFollower, **PATIENT, progress_timeout=15.0)


def real(slip=0.0, **values):
    return (
        lambda: Simulator(overrides(roller_slip=slip, **ROBOT_SETTINGS)),
        lambda: Manipulation(overrides(**ROBOT_SETTINGS)),
        node(**values),
    )


def goal(*steps, begin=HOME, frame='truss', **fields):
    """Return a goal: a path from `begin` by steps (dx, dy, dangle)."""
    path = Path()
    path.header.frame_id = frame
    poses = np.cumsum([begin, *steps], axis=0)
    path.poses = [PoseStamped(pose=to_pose_message(core.Pose(*pose))) for pose in poses.tolist()]
    return FollowObjectPath.Goal(path=path, **({'speed': 0.03, 'turn_rate': 0.3} | fields))


def twists(w):
    """Return all twists so far (k, 3)."""
    messages = [message for _, message in w.probe.seen['twist']]
    return np.array([(m.linear.x, m.linear.y, m.angular.z) for m in messages]).reshape(-1, 3)


def moves(w):
    return bool(twists(w)[-1:].any())


def until_ended(w, handle, send=lambda: None):
    """Spin until a goal has ended; return status of the action, code and result."""
    status, result = w.finish(handle, send)
    return status, result.code, result


@contextlib.contextmanager
def listening(*makers, **options):
    """Yield a world whose probe listens to the twists."""
    with world(*makers, **options) as w:
        w.probe.listen(Twist, 'twist', 'cmd_vel')
        yield w


@contextlib.contextmanager
def simulated(**values):
    """Yield a world of follower, manipulation and simulator, which has published."""
    with listening(*real(**values)) as w:
        w.until(lambda: w.place() is not None)
        yield w


@pytest.mark.parametrize('smooth', some_now([True, False]))
def test_carries_the_object_along_a_straight_or_smooth_path_to_its_end(smooth):
    steps = (0.0, 0.03, 0.0), (0.015, 0.0, 0.2)
    with simulated(slip=0.05, smooth_path=smooth) as w:
        handle = w.send_goal(goal(*steps, position_tolerance=0.02))
        status, code, result = until_ended(w, handle)
        assert (status, code) == (GoalStatus.STATUS_SUCCEEDED, Result.REACHED)
        assert 'off the end of the path' in result.message
        # A spline swings out by 4 mm before the corner.
        left = HOME[0] - min(m.pose.position.x for _, m in w.probe.seen['pose'])
        assert (left > 2.5e-3) == smooth
        assert result.stamp == w.nodes[3].get_clock().now().to_msg()
        off = np.abs(w.place() - np.sum([HOME, *steps], axis=0))
        assert np.hypot(*off[:2]) < 0.01
        assert off[2] < 0.1
        assert 0.0 < result.rms_position_error < result.max_position_error < 0.02
        assert result.position_error <= result.max_position_error
        assert 0.0 < result.angle_error <= result.max_angle_error < 0.1
        assert all(part.position_error > 0.0 for part in handle.feedback[1:])
        assert handle.feedback[-1].angle_error > 0.0  # the object turns on the second leg only
        # Feedback: about 10 Hz, forward, and the time it takes.
        progress = [part.progress for part in handle.feedback]
        assert len(progress) > 10
        assert (np.diff(progress) >= 0.0).all()
        assert handle.feedback[0].time_left == pytest.approx(1.0 + 0.2 / 0.3 + 0.5, abs=0.2)
        assert handle.feedback[-1].time_left < 0.5
        # At rest at the end, and silent from then on.
        assert not moves(w)
        count = len(twists(w))
        w.spin(0.3)
        assert len(twists(w)) == count


@pytest.mark.parametrize(
    ('tolerance', 'moved'),
    [
        ({'angle_tolerance': 0.05}, (0.0, 0.0, 0.06)),
        ({'position_tolerance': 0.03}, (0.04, 0.0, 0.0)),
    ],
)
def test_path_is_left_where_an_error_exceeds_its_tolerance(tolerance, moved):
    for share, outcome in ((0.7, Result.STOPPED), (1.0, Result.OFF_PATH)):
        with listening(node(progress_timeout=1.0)) as w:
            w.spin(0.2, fake(w))
            handle = w.send_goal(goal(UP, begin=PROBED, **tolerance))
            w.until(lambda: moves(w), fake(w))
            _, code, result = until_ended(
                w, handle, fake(w, np.add(PROBED, share * np.array(moved)))
            )
        assert code == outcome
    assert result.angle_error == pytest.approx(moved[2], abs=1e-3)


def test_stops_at_once_when_cancelled():
    with simulated() as w:
        handle = w.send_goal(goal((0.0, 0.2, 0.0)))
        w.until(lambda: w.place()[1] > HOME[1] + 0.01)
        assert handle.cancel()
        status, code, result = until_ended(w, handle)
        assert (status, code) == (GoalStatus.STATUS_CANCELED, Result.CANCELLED)
        assert result.max_position_error > 0.0
        w.until(lambda: not moves(w))
        w.until(lambda: not np.any(w.probe.last('joints').velocity))
        there = w.travel()
        w.spin(0.2)
        assert w.travel() == pytest.approx(there, abs=0.0)
        assert w.place()[1] < HOME[1] + 0.1


def changed(**values):
    """Return a goal of which one pose has another orientation or frame."""
    result = goal(UP, begin=PROBED)
    pose = result.path.poses[1]
    pose.pose.orientation = values.get('orientation', pose.pose.orientation)
    pose.header.frame_id = values.get('frame', '')
    return result


UP, DOWN = (0.0, 0.02, 0.0), (0.0, -0.02, 0.0)
BAD_GOALS = {
    'no poses': (FollowObjectPath.Goal(), 'two or more'),
    'nowhere': (goal((0.0, 0.0, 0.0), begin=PROBED), 'two or more must differ'),
    'frame': (goal(UP, begin=PROBED, frame='world'), "path in frame 'world': must be in 'truss'"),
    'frame of a pose': (changed(frame='map'), 'pose 1 of the path in frame'),
    'far': (goal(UP, begin=(0.0, 0.0, 0.3)), 'the path begins'),
    'not finite': (goal((0.0, math.nan, 0.0), begin=PROBED), 'pose 1 of the path'),
    'no rotation': (changed(orientation=Quaternion(w=2.0)), 'quaternion has norm 2'),
    'half a turn': (goal(begin=(*CENTER, 0.3 - math.pi)), 'pose 0 of the path is half a turn'),
    'fifty metres away': (goal(begin=(50.0, 0.0, 0.3)), 'pose 0 of the path: (50, 0) m is'),
    'in millimetres': (goal(begin=(700.0, 0.0, 0.3)), 'if it is in mm, it is 0.7 m'),
    'endless': (goal(*5000 * (UP, DOWN), begin=PROBED), 'has 10001 poses; must be at most 10000'),
    'no tolerance': (goal(UP, begin=PROBED, position_tolerance=0.0), 'position_tolerance 0.0'),
    'no tolerance of the angle': (
        goal(UP, begin=PROBED, angle_tolerance=-0.1),
        'angle_tolerance -0.1',
    ),
}


def fake(w, pose=PROBED, rollers=True):
    """Return a call that publishes rollers and object at rest, and a status."""
    statuses = w.probe.create_publisher(ManipulationStatus, 'manipulation/status', 1)

    def send():
        w.probe.send_object(pose)
        if rollers:
            w.probe.send_joints()
        status = ManipulationStatus(code=int(core.Status.OK), scale=1.0)
        status.header = make_header(w.probe.past(0.0))
        statuses.publish(status)

    return send


def begin(w, send):
    w.spin(0.2, send)
    handle = w.send_goal(goal(UP, begin=PROBED))
    w.until(lambda: moves(w), send)
    return handle


def test_bad_goals_are_aborted_with_the_reason_and_move_nothing():
    with listening(node()) as w:
        send = fake(w)
        # Without a pose of the object it is unknown whether a goal is bad.
        assert until_ended(w, w.send_goal(goal(UP)))[:2] == STOPPED
        w.spin(0.2, send)
        for name, (request, words) in BAD_GOALS.items():
            status, code, result = until_ended(w, w.send_goal(request), send)
            assert (status, code) == (GoalStatus.STATUS_ABORTED, Result.BAD_GOAL), name
            assert words in result.message, name
            assert math.isnan(result.max_position_error)
        assert not twists(w).any()


def test_an_inactive_node_accepts_no_goals_and_ends_the_active_one():
    with listening(node()) as w:
        manager, send = Manager(w, 'path_follower'), fake(w)
        replaced, handle = begin(w, send), begin(w, send)
        preempted = (GoalStatus.STATUS_ABORTED, Result.PREEMPTED)
        assert until_ended(w, replaced)[:2] == preempted
        # The object stays behind, at its angle.
        w.until(lambda: float(w.detail(ERROR, 'path_follower') or 0.0) > 0.002, send)
        assert manager.ask(Transition.TRANSITION_DEACTIVATE)
        status, code, result = until_ended(w, handle)
        assert (status, code) == STOPPED
        assert 'deactivated' in result.message
        w.until(lambda: not moves(w))
        assert not w.send_goal(goal(UP, begin=PROBED)).accepted
        assert manager.ask(Transition.TRANSITION_ACTIVATE)
        assert begin(w, send).accepted
        assert manager.ask(Transition.TRANSITION_ACTIVE_SHUTDOWN)
        w.until(lambda: not moves(w))


def test_aborts_when_simulated_time_stops_or_jumps_back():
    with listening(node(use_sim_time=True, command_timeout=1.0), sim_time=True) as w:
        send = fake(w)
        times = itertools.count(100.0, 0.01)

        def run():
            w.probe.tick(next(times))
            send()

        status, code, result = until_ended(w, begin(w, run), send)
        assert (status, code) == STOPPED
        assert 'time stopped' in result.message
        assert not moves(w)

        handle = begin(w, run)
        times = itertools.count(50.0, 0.01)
        w.until(lambda: not moves(w), lambda: w.probe.tick(next(times)))
        assert until_ended(w, handle, lambda: w.probe.tick(next(times)))[:2] == STOPPED


def test_a_supervised_goal_ends_with_its_client():
    with simulated(command_timeout=0.5) as w:
        supervision = w.probe.create_publisher(GoalInfo, 'supervised_goal', 1)
        handle = w.send_goal(goal((0.0, 0.2, 0.0), speed=0.01))
        w.spin(0.7, lambda: supervision.publish(handle.info))
        assert moves(w)
        silent = w.now
        status, code, result = until_ended(w, handle)
        assert (status, code) == STOPPED
        assert 'supervises the goal' in result.message
        assert w.now - silent < 0.6
        assert not moves(w)


BOX = (
    '{shape: polygon, corner_radius: 0.02, friction: 0.8, '
    'vertices: [[-0.15, -0.1], [0.15, -0.1], [0.15, 0.1], [-0.15, 0.1]]}'
)
#: Object, step of its path and reason why the path cannot be executed.
REFUSED = {
    'box': (BOX, (0.3, 0.2, 0.0), r'would end after \d+ cm.*, at \(0\.\d+, 0\.\d+\): the slip'),
    'disc': (
        '{shape: disc, diameter: 0.3, friction: 0.8}',
        (0.2, 0.5, 0.1),
        r'out of reach after \d+ cm and \+\d+°.*, at \(\d\.\d{3}, \d\.\d{3}\)',
    ),
}


@contextlib.contextmanager
def refusing(name, silence=0.0):
    """Yield a world with a path that cannot be executed, and its inputs; rollers may be silent."""
    described, step, _ = REFUSED[name]
    members, shape = members_at(ROBOT, 'north/Z'), core.read_object(described).shape
    body = core.place_between(ROBOT.home, members, shape, indentation=0.02).body
    with listening(node(object=described, command_timeout=0.5)) as w:
        w.spin(0.2, fake(w, body.pose))
        send = fake(w, body.pose, rollers=not silence)
        w.spin(silence, send)
        yield w, w.send_goal(goal(step, begin=body.pose)), send


@pytest.mark.parametrize('name', some_now(REFUSED))
def test_a_path_that_cannot_be_executed_is_refused_with_the_pose_of_its_end(name):
    with refusing(name) as (w, handle, send):
        status, code, result = until_ended(w, handle, send)
        assert (status, code) == (GoalStatus.STATUS_ABORTED, Result.BAD_GOAL)
        assert re.search(REFUSED[name][2], result.message)
        assert not twists(w).any()


def test_a_path_is_predicted_from_the_inputs_at_its_goal():
    described, step, words = REFUSED['box']
    members, shape = members_at(ROBOT, 'north/Z'), core.read_object(described).shape
    body = core.place_between(ROBOT.home, members, shape, indentation=0.02).body
    calls, foreseen = [], Future()

    def submit(_pool, *call):
        calls.append(call)
        return foreseen

    with listening(node(object=described)) as w, pytest.MonkeyPatch.context() as patch:
        send = fake(w, body.pose)
        w.spin(0.2, send)
        # A thread that is late.
        patch.setattr(ThreadPoolExecutor, 'submit', submit)
        handle = w.send_goal(goal(step, begin=body.pose))
        w.nodes[1].inputs.clear()
        ((check, *arguments),) = calls
        with pytest.raises(core.IsotrussError, match=words) as error:
            check(*arguments)
        foreseen.set_exception(error.value)
        assert until_ended(w, handle, send)[1] == Result.BAD_GOAL


def test_a_path_is_not_predicted_without_the_positions_of_the_rollers():
    with refusing('box', silence=0.6) as (w, _, send):
        w.until(lambda: moves(w), send)


def test_the_time_left_is_that_of_the_predicted_motion():
    """Three members around a disc are near a singular task, so the path is slower than asked."""
    body = core.place_between(ROBOT.home, AROUND, core.Disc(0.87), indentation=0.01).body
    described = '{shape: disc, diameter: 0.87, friction: 0.8}'
    with listening(node(object=described, command_timeout=0.5)) as w:
        send = fake(w, body.pose)
        w.spin(0.2, send)
        asked = goal((0.0, 0.03, 0.0), begin=body.pose, speed=0.02, turn_rate=0.2)
        handle = w.send_goal(asked)
        w.until(lambda: moves(w) and handle.feedback, send)
        w.until(lambda: np.isfinite(handle.feedback[-1].time_left), send)
        assert handle.feedback[-1].time_left > 5.0  # 2 s at full rate


def test_a_path_of_one_pose_begins_at_the_object():
    start, end = core.Pose(*PROBED), core.Pose(CENTER[0], CENTER[1] + 0.02, 0.3)

    def read(pose):
        return read_object_path(goal(begin=pose).path, 0.03, 0.3, ROBOT, False, start)

    path = read(end)
    assert [*path.poses[0], *path.poses[-1]] == pytest.approx([*start, *end])
    assert read(start) is None


#: Pose of an obstacle 21 mm from the object, in the way of the twists of the probe [m, rad].
ABOVE = CENTER[0], CENTER[1] + 0.5 * DIAMETER + 0.05 + 0.021, 0.0
POST = f'{{post: {{shape: disc, diameter: 0.1, pose: {list(map(float, ABOVE))}}}}}'
START = core.tangent_center(ROBOT.home, MODULE, DIAMETER, 0.02)
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


HAND = core.Obstacle('hand', core.ConvexObject(core.Disc(0.1), ABOVE))


@pytest.mark.parametrize(('room', 'moving', 'name'), [(POST, (), 'post'), ('', (HAND,), 'hand')])
def test_obstacle_at_rest_or_in_motion_slows_the_object_with_its_name(room, moving, name):
    with world(manipulation(obstacles=room, slide_along_limits=False)) as w:
        send = publisher(w)
        w.until_code(core.Status.SLOWED_OBSTACLE if room else core.Status.OK, send)
        status = w.until_code(core.Status.SLOWED_OBSTACLE, lambda: send(*moving))
    assert f'the object and obstacle {name}' in status.message


def test_silent_obstacle_stops_the_rollers_until_it_is_cleared():
    with world(manipulation(obstacle_timeout=0.3)) as w:
        send = publisher(w)
        far = (CENTER[0] + 5.0, CENTER[1], 0.0)
        hand, cart = (
            core.Obstacle(name, core.ConvexObject(core.Disc(0.1), far))
            for name in ('hand', 'cart')
        )
        w.spin(0.3, lambda: send(hand, cart))
        assert w.code() == core.Status.OK
        # The message goes on without the hand.
        status = w.until_code(core.Status.HALT_STALE_OBSTACLES, lambda: send(cart))
        assert 'moving obstacle hand' in status.message
        answer = w.call('clear_obstacles', Trigger.Request())
        assert answer.success
        assert 'hand' in answer.message
        w.until_code(core.Status.OK, lambda: send(cart))


@pytest.mark.parametrize('by', [-3600.0, -3.0])
def test_obstacles_from_before_a_clock_jump_halt_the_rollers_until_they_are_known_again(by):
    with world(manipulation(obstacle_timeout=0.5)) as w:
        send, (hand,) = publisher(w), far_away('hand')
        w.spin(0.3, lambda: send(hand))
        assert w.code() == core.Status.OK
        w.shift = by
        w.spin(0.5, send)
        assert w.code() == core.Status.HALT_INVALID_OBSTACLES
        w.until_code(core.Status.OK, lambda: send(hand))


def test_age_of_obstacles_is_judged_by_their_own_timeout():
    with world(manipulation(command_timeout=0.2, obstacle_timeout=1.0)) as w:
        send, (hand,) = publisher(w), far_away('hand')
        late = w.probe.create_publisher(Obstacles, 'obstacles', 10)

        def send_late():
            send()
            late.publish(to_obstacles_message([hand], w.probe.past(0.5), 'truss'))

        w.spin(0.5, send_late)
        assert w.code() == core.Status.OK
        assert 'hand' in w.call('clear_obstacles', Trigger.Request()).message


def far_away(*names):
    """Return obstacles of these names 5 m from the object."""
    place = core.ConvexObject(core.Disc(0.1), (CENTER[0] + 5.0, CENTER[1], 0.0))
    return [core.Obstacle(name, place) for name in names]


def test_names_of_obstacles_are_bounded_and_leave_when_they_have_ended():
    with world(manipulation(obstacle_timeout=0.1)) as w:
        send = publisher(w)
        first, second = far_away(*map(str, range(150))), far_away(*map(str, range(150, 300)))
        w.until_code(core.Status.OK, lambda: send(*first))
        status = w.until_code(core.Status.HALT_STALE_OBSTACLES, lambda: send(*second))
        assert '300 names in the messages; must be at most 200' in status.message
        w.until_code(core.Status.OK, lambda: send(*second))
        assert w.call('clear_obstacles', Trigger.Request()).message.count(',') == 149


def test_message_with_more_obstacles_than_a_cycle_can_keep_is_refused_with_their_number():
    with world(manipulation()) as w:
        send, many = publisher(w), far_away(*map(str, range(201)))
        status = w.until_code(core.Status.HALT_INVALID_OBSTACLES, lambda: send(*many))
    assert '201 in a message; must be at most 200' in status.message


def test_invalid_first_message_of_obstacles_stops_the_rollers_with_the_reason():
    with world(manipulation()) as w:
        send = publisher(w)
        status = w.until_code(core.Status.HALT_INVALID_OBSTACLES, lambda: send(HAND, HAND))
    assert "'hand': named twice" in status.message


@pytest.mark.parametrize('text', ['{post: {shape: disc, diameter: 0.1}}', '/no/such/file.yaml'])
def test_invalid_obstacles_of_the_parameter_are_refused(text):
    check_refused(manipulation(obstacles=text), "key 'pose'|cannot be read")


def test_markers_show_the_obstacles_at_rest_and_the_moving_ones():
    box = core.Polygon(((-0.1, -0.05), (0.1, -0.05), (0.1, 0.05), (-0.1, 0.05)))
    moving = [
        core.Obstacle('hand', core.ConvexObject(core.Ellipse((0.1, 0.2)), (5.0, 1.0, 0.5))),
        core.Obstacle('cart', core.ConvexObject(box, (6.0, 1.0, 0.5))),
    ]
    with world(manipulation(obstacles=POST)) as w:
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
        target = PoseStamped(pose=to_pose_message(core.Pose(*goal)))
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
    post = core.Obstacle('post', core.ConvexObject(core.Disc(0.1), place))
    room = f'{{post: {{shape: disc, diameter: 0.1, pose: {list(map(float, place))}}}}}'
    moving, at_rest = ((post,), '') if is_published else ((), room)
    result, asked, _ = move(monkeypatch, goal, *moving, obstacles=at_rest)
    assert result.code == MoveObject.Result.STOPPED
    assert 'no way found' in result.message
    assert 'obstacle post' in result.message
    assert asked is None
