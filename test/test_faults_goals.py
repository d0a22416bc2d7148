"""The nodes that pursue goals, killed in mid-motion: the robot rests until somebody asks anew."""

import signal

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseStamped
from isotruss_msgs.action import FollowObjectPath
from isotruss_ros.core import Pose, Status
from isotruss_ros.nodes.messages import pose_message
from nav_msgs.msg import Path
import numpy as np
from probe import N, ROBOT
import pytest
from rclpy.action import ActionClient
from robot_processes import robot, TIMEOUT
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

pytestmark = pytest.mark.nodes

#: A busy machine delays [s].
SLACK = 1.5
MAX_SPEED = ROBOT.description.max_speed


def check_rests(r, at):
    """Check that the rollers stop within the time-out of what they were told last, and stay."""
    r.w.until(lambda: not r.moving())
    assert np.abs(r.travel() - at).max() < MAX_SPEED * (TIMEOUT + SLACK)
    at, count = r.travel(), len(r.w.probe.seen['joints'])
    r.w.until(lambda: len(r.w.probe.seen['joints']) > count + 30)
    assert np.array_equal(r.travel(), at)


def test_a_path_ends_with_its_follower_and_the_next_one_goes_on(tmp_path):
    with robot(tmp_path) as r:
        w = r.w
        client = ActionClient(w.probe, FollowObjectPath, 'follow_object_path')

        def go(height):
            """Ask for a way up from where the object is, until it moves."""
            asked = []

            def ask():
                here = w.probe.last('pose').pose.position
                ends = [Pose(here.x, here.y, 0.0), Pose(here.x, here.y + height, 0.0)]
                path = Path(poses=[PoseStamped(pose=pose_message(pose)) for pose in ends])
                path.header.frame_id = 'truss'
                goal = FollowObjectPath.Goal(path=path, speed=0.02)
                asked.append(client.send_goal_async(goal))

            # A server that was killed is there for a while, and does not answer.
            w.until(lambda: w.probe.last('pose') is not None)
            w.until(r.moving, ask, period=1.0)
            w.until(asked[-1].done)
            return asked[-1].result().get_result_async()

        for name in ('simulator', 'manipulation', 'path_follower'):
            r.start(name)
        w.until(lambda: w.code() == Status.HALT_NO_TWIST)
        go(0.2)
        at = r.travel()
        r.signal('path_follower', signal.SIGKILL)
        check_rests(r, at)
        assert w.code() == Status.HALT_NO_TWIST
        r.start('path_follower')
        w.probe.seen['diagnostics'].clear()
        w.until(lambda: bool(w.report('path_follower').name))
        check_rests(r, r.travel())  # nobody goes on with the old path
        ended = go(0.01)
        w.until(ended.done)
        assert ended.result().result.code == FollowObjectPath.Result.REACHED


def test_a_way_ends_with_the_node_that_drives_it_and_the_next_one_goes_on(tmp_path):
    with robot(tmp_path) as r:
        w = r.w
        topic = 'joint_trajectory_controller/joint_trajectory'
        ways = w.probe.create_publisher(JointTrajectory, topic, 1)

        def go(way):
            """Send the rollers on a way from where they are, until they move."""
            w.until(lambda: ways.get_subscription_count() > 0)
            w.until(lambda: w.probe.last('joints') is not None)

            def send():
                begin = r.travel()
                points = [
                    JointTrajectoryPoint(positions=(begin + share * way).tolist())
                    for share in (0.0, 1.0)
                ]
                points[1].time_from_start = Duration(sec=round(20.0 * np.abs(way).max()))
                names = list(ROBOT.roller_names)
                ways.publish(JointTrajectory(joint_names=names, points=points))

            w.until(r.moving, send, period=0.5)

        r.start('simulator')
        r.start('roller_trajectory')
        go(np.full(N, 0.2))
        at = r.travel()
        r.signal('roller_trajectory', signal.SIGKILL)
        check_rests(r, at)
        r.start('roller_trajectory')
        w.until(lambda: 'no trajectory' in w.report('roller_trajectory').message)
        check_rests(r, r.travel())
        go(np.full(N, -0.05))
        w.until(lambda: 'have arrived' in w.report('roller_trajectory').message)
