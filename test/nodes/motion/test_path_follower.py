# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The path follower: with simulator and manipulation, and with a world that misbehaves."""

import itertools
import math
import re

from action_msgs.msg import GoalInfo, GoalStatus
from geometry_msgs.msg import PoseStamped, Quaternion, Twist
from isotruss_msgs.action import FollowObjectPath
from isotruss_msgs.msg import ManipulationStatus
from isotruss_ros.core import place_between, Pose, read_object, Status
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.nodes.conversions.messages import make_header, to_pose_message
from isotruss_ros.nodes.conversions.path_messages import read_object_path
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.path_follower import PathFollower
from isotruss_ros.nodes.simulator.node import Simulator
from lifecycle_msgs.msg import Transition
from manual_world import Manager, world
from nav_msgs.msg import Path
import numpy as np
from probe import CENTER, maker, overrides, ROBOT
import pytest

Result = FollowObjectPath.Result
#: In the grip at home, as the simulator puts it, and as the probe puts it.
HOME = (*CENTER, 0.0)
PROBED = (*CENTER, 0.3)


#: For machines so busy that nodes wait for their turn: the follower goes on, the robot waits too.
PATIENT = {'command_timeout': 5.0, 'rate': 50.0}
ROBOT_SETTINGS = {'command_timeout': 0.5, 'rate': 50.0}


node = maker(PathFollower, **PATIENT, progress_timeout=15.0)


def real(slip=0.0, stamped=False, **values):
    """Return the three nodes that it takes."""
    return (
        lambda: Simulator(overrides(roller_slip=slip, **ROBOT_SETTINGS)),
        lambda: Manipulation(overrides(use_stamped_twist=stamped, **ROBOT_SETTINGS)),
        node(use_stamped_twist=stamped, **values),
    )


def goal(*steps, begin=HOME, frame='truss', **fields):
    """Return a goal: a path from `begin` by steps (dx, dy, dangle)."""
    path = Path()
    path.header.frame_id = frame
    poses = np.cumsum([begin, *steps], axis=0)
    path.poses = [PoseStamped(pose=to_pose_message(Pose(*pose))) for pose in poses.tolist()]
    return FollowObjectPath.Goal(path=path, **({'speed': 0.03, 'turn_rate': 0.3} | fields))


class Client:
    """
    Sends goals, and looks at the twists.

    :param w: the world.
    :param kind: of the twists.
    """

    def __init__(self, w, kind=Twist):
        self._world = w
        w.probe.listen(kind, 'twist', 'cmd_vel')

    def send(self, asked, each=lambda: None):
        """Send a goal and return its handle."""
        each()
        return self._world.send_goal(asked)

    def result(self, handle, each=lambda: None):
        """Return how it ended: status of the action, result."""
        self._world.until(lambda: handle.ended, each)
        return handle.result()

    def follow(self, asked, each=lambda: None):
        """Send a goal and wait for its end."""
        handle = self.send(asked, each)
        assert handle.accepted
        return self.result(handle, each)

    def twists(self):
        """Return all twists so far (k, 3)."""
        result = [planar(message) for _, message in self._world.probe.seen['twist']]
        return np.array(result).reshape(-1, 3)

    def moves(self):
        """Tell whether the last twist moves the object."""
        return bool(self.twists()[-1:].any())


def planar(twist):
    return twist.linear.x, twist.linear.y, twist.angular.z


def test_carries_the_object_to_the_end_of_the_path():
    steps = (0.0, 0.04, 0.0), (0.02, 0.0, 0.3)
    with world(*real(slip=0.05)) as w:
        client = Client(w)
        w.until(lambda: w.probe.last('pose') is not None)
        handle = client.send(goal(*steps, position_tolerance=0.02))
        status, result = client.result(handle)
        assert (status, result.code) == (GoalStatus.STATUS_SUCCEEDED, Result.REACHED)
        assert 'off the end of the path' in result.message
        wanted = np.sum([HOME, *steps], axis=0)
        assert np.hypot(*(w.place() - wanted)[:2]) < 0.01
        assert abs((w.place() - wanted)[2]) < 0.1
        assert 0.0 < result.rms_position_error < result.max_position_error < 0.02
        assert result.position_error <= result.max_position_error
        assert 0.0 < result.angle_error <= result.max_angle_error < 0.1
        assert all(each.position_error > 0.0 < each.angle_error for each in handle.feedback[1:])
        # Feedback: about 10 Hz, forward, and the time it takes.
        progress = [message.progress for message in handle.feedback]
        assert len(progress) > 10
        assert (np.diff(progress) >= 0.0).all()
        left = [message.time_left for message in handle.feedback]
        assert left[0] == pytest.approx(0.04 / 0.03 + 1.0 + 0.5, abs=0.2)
        assert left[-1] < 0.5
        # At rest at the end, and silent from then on.
        assert not client.moves()
        count = len(client.twists())
        w.spin(0.3)
        assert len(client.twists()) == count


def test_stops_at_once_when_cancelled():
    with world(*real()) as w:
        client = Client(w)
        w.until(lambda: w.probe.last('pose') is not None)
        handle = client.send(goal((0.0, 0.2, 0.0)))
        w.until(lambda: w.place()[1] > HOME[1] + 0.01)
        assert handle.cancel()
        status, result = client.result(handle)
        assert (status, result.code) == (GoalStatus.STATUS_CANCELED, Result.CANCELLED)
        assert result.max_position_error > 0.0
        w.until(lambda: not client.moves())
        w.until(lambda: not np.any(w.probe.last('joints').velocity))
        there = w.probe.last('joints').position
        w.spin(0.2)
        assert w.probe.last('joints').position == there
        assert w.place()[1] < HOME[1] + 0.1


BROKEN = Quaternion(w=2.0)


def bend(asked, orientation):
    """Return a goal of which one pose has another orientation."""
    asked.path.poses[1].pose.orientation = orientation
    return asked


def elsewhere(asked, frame):
    """Return a goal of which one pose is in another frame."""
    asked.path.poses[1].header.frame_id = frame
    return asked


def endless(asked):
    """Return a goal of very many poses."""
    asked.path.poses = [asked.path.poses[i % 2] for i in range(10_001)]
    return asked


UP = (0.0, 0.02, 0.0)
BAD_GOALS = {
    'no poses': (FollowObjectPath.Goal(), 'two or more'),
    'nowhere': (goal((0.0, 0.0, 0.0), begin=PROBED), 'two or more must differ'),
    'frame': (goal(UP, begin=PROBED, frame='world'), "path in frame 'world': must be in 'truss'"),
    'frame of a pose': (elsewhere(goal(UP, begin=PROBED), 'map'), 'pose 1 of the path in frame'),
    'far': (goal(UP, begin=(0.0, 0.0, 0.3)), 'the path begins'),
    'not finite': (goal((0.0, math.nan, 0.0), begin=PROBED), 'pose 1 of the path'),
    'no rotation': (bend(goal(UP, begin=PROBED), BROKEN), 'quaternion has norm 2'),
    'half a turn': (goal(begin=(*CENTER, 0.3 - math.pi)), 'pose 0 of the path is half a turn'),
    'fifty metres away': (goal(begin=(50.0, 0.0, 0.3)), 'pose 0 of the path: (50, 0) m is'),
    'in millimetres': (goal(begin=(700.0, 0.0, 0.3)), 'if it is in mm, it is 0.7 m'),
    'endless': (endless(goal(UP, begin=PROBED)), 'has 10001 poses; must be at most 10000'),
    'no tolerance': (goal(UP, begin=PROBED, position_tolerance=0.0), 'position_tolerance 0.0'),
}


def fake(w, pose=PROBED, rollers=True):
    """Return a call that publishes rollers and object at rest, and a status."""
    statuses = w.probe.create_publisher(ManipulationStatus, 'manipulation/status', 1)

    def send():
        header = make_header(w.probe.past(0.0), 'truss')
        placed = to_pose_message(Pose(*pose))
        w.probe.object_poses.publish(PoseStamped(header=header, pose=placed))
        if rollers:
            w.probe.send_joints()
        status = ManipulationStatus(code=int(Status.OK), scale=1.0)
        status.header = make_header(w.probe.past(0.0))
        statuses.publish(status)

    return send


def begin(w, each):
    """Return a client and the handle of a goal that moves the object, with what is published."""
    client = Client(w)
    w.spin(0.2, each)
    handle = client.send(goal(UP, begin=PROBED), each)
    w.until(client.moves, each)
    return client, handle


def test_bad_goals_are_aborted_with_the_reason_and_move_nothing():
    with world(node()) as w:
        client = Client(w)
        tell = fake(w)
        w.spin(0.2, tell)
        for name, (asked, words) in BAD_GOALS.items():
            status, result = client.follow(asked, tell)
            assert (status, result.code) == (GoalStatus.STATUS_ABORTED, Result.BAD_GOAL), name
            assert words in result.message, name
            assert math.isnan(result.max_position_error)
        assert not client.twists().any()


def test_an_inactive_node_accepts_no_goals_and_ends_the_active_one():
    with world(node()) as w:
        manager, tell = Manager(w, 'path_follower'), fake(w)
        client, handle = begin(w, tell)
        assert manager.ask(Transition.TRANSITION_DEACTIVATE)
        status, result = client.result(handle)
        assert (status, result.code) == (GoalStatus.STATUS_ABORTED, Result.STOPPED)
        assert 'deactivated' in result.message
        w.until(lambda: not client.moves())
        assert not client.send(goal(UP, begin=PROBED), tell).accepted
        assert manager.ask(Transition.TRANSITION_ACTIVATE)
        w.spin(0.2, tell)
        assert client.send(goal(UP, begin=PROBED), tell).accepted
        # Everything at once, with a goal under way.
        w.until(client.moves, tell)
        assert manager.ask(Transition.TRANSITION_ACTIVE_SHUTDOWN)
        w.until(lambda: not client.moves())
        w.spin(0.2)


def test_aborts_when_simulated_time_stops_or_jumps_back():
    with world(node(use_sim_time=True, command_timeout=1.0), sim_time=True) as w:
        tell = fake(w)
        times = itertools.count(100.0, 0.01)

        def run():
            w.probe.tick(next(times))
            tell()

        client, handle = begin(w, run)
        status, result = client.result(handle, tell)
        assert (status, result.code) == (GoalStatus.STATUS_ABORTED, Result.STOPPED)
        assert 'time stopped' in result.message
        assert not client.moves()

        client, handle = begin(w, run)
        times = itertools.count(50.0, 0.01)
        w.until(lambda: not client.moves(), lambda: w.probe.tick(next(times)))
        status, result = client.result(handle, lambda: w.probe.tick(next(times)))
        assert (status, result.code) == (GoalStatus.STATUS_ABORTED, Result.STOPPED)


def test_a_supervised_goal_ends_with_its_client():
    with world(*real(command_timeout=0.5)) as w:
        client = Client(w)
        supervision = w.probe.create_publisher(GoalInfo, 'supervised_goal', 1)
        w.until(lambda: w.probe.last('pose') is not None)
        handle = client.send(goal((0.0, 0.2, 0.0), speed=0.01))
        w.spin(2.0, lambda: supervision.publish(handle.info))
        assert client.moves()
        silent = w.now
        status, result = client.result(handle)
        assert (status, result.code) == (GoalStatus.STATUS_ABORTED, Result.STOPPED)
        assert 'supervises the goal' in result.message
        assert w.now - silent < 0.6
        assert not client.moves()


BOX = (
    '{shape: polygon, corner_radius: 0.02, friction: 0.8, '
    'vertices: [[-0.15, -0.1], [0.15, -0.1], [0.15, 0.1], [-0.15, 0.1]]}'
)
DISC = '{shape: disc, diameter: 0.3, friction: 0.8}'


@pytest.mark.parametrize(
    ('described', 'step', 'words'),
    [
        (
            BOX,
            (0.3, 0.2, 0.0),
            r'would end after \d+ cm.*, at \(0\.\d+, 0\.\d+\): the slip margin',
        ),
        (DISC, (1.5, 0.0, 0.2), r'out of reach after \d+ cm.*, at \(\d\.\d{3}, \d\.\d{3}\)'),
    ],
)
def test_a_path_that_cannot_be_executed_is_refused_with_the_pose_of_its_end(
    described, step, words
):
    members, shape = members_at(ROBOT, 'north/Z'), read_object(described).shape
    body = place_between(ROBOT.home, members, shape, indentation=0.02).body
    with world(node(object=described)) as w:
        client, tell = Client(w), fake(w, body.pose)
        w.spin(0.2, tell)
        status, result = client.follow(goal(step, begin=body.pose), tell)
        assert (status, result.code) == (GoalStatus.STATUS_ABORTED, Result.BAD_GOAL)
        assert re.search(words, result.message)
        assert not client.twists().any()
        # Without the positions of the rollers nothing is predicted.
        w.spin(PATIENT['command_timeout'], fake(w, body.pose, rollers=False))
        client.send(goal(step, begin=body.pose))
        w.until(client.moves, fake(w, body.pose, rollers=False))


def test_a_path_of_one_pose_begins_at_the_object():
    start, end = Pose(*PROBED), Pose(CENTER[0], CENTER[1] + 0.02, 0.3)

    def read(pose):
        return read_object_path(goal(begin=pose).path, 0.03, 0.3, ROBOT, False, start)

    path = read(end)
    assert [*path.poses[0], *path.poses[-1]] == pytest.approx([*start, *end])
    assert read(start) is None
