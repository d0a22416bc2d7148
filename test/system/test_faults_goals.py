# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The nodes that pursue goals, killed in mid-motion: the robot rests until somebody asks anew."""

import signal

from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseStamped
from isotruss_msgs.action import FollowObjectPath
from isotruss_ros.core import Pose, Status
from isotruss_ros.nodes.conversions.messages import to_pose_message
from nav_msgs.msg import Path
import numpy as np
from probe import N, ROBOT
import pytest
from rclpy.action import ActionClient
from robot_processes import robot
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

pytestmark = pytest.mark.system

Result = FollowObjectPath.Result
#: A goal ends when inputs are late, and a busy machine delays them.
PATIENT = {'command_timeout': 5.0}


class Paths:
    """Asks for paths up and down from where the object is, as any action client does."""

    def __init__(self, r):
        self._r = r
        self._client = ActionClient(r.w.probe, FollowObjectPath, 'follow_object_path')
        self._asked, self._results = None, []

    def ask(self, height, speed=0.02):
        """Send a goal; return the future of its handle."""
        here = self._r.w.probe.last('pose').pose.position
        ends = [Pose(here.x, here.y, 0.0), Pose(here.x, here.y + height, 0.0)]
        path = Path(poses=[PoseStamped(pose=to_pose_message(pose)) for pose in ends])
        path.header.frame_id = 'truss'
        return self._client.send_goal_async(FollowObjectPath.Goal(path=path, speed=speed))

    def go(self, height, speed=0.02):
        """Ask until the object moves; return the handle of the goal."""
        w = self._r.w
        self._asked = None

        def each():
            if not self._pursued():
                self._asked, self._results = self.ask(height, speed), []

        w.until(lambda: w.probe.last('pose') is not None)
        w.until(self._r.moving, each, period=3.0)
        return self.accepted(self._asked)

    def _pursued(self):
        """
        Return whether the last goal was accepted and is not over.

        A server that was killed is there for a while and does not answer, and a goal may end at
        once where inputs are not all there.
        """
        if self._asked is None or not self._asked.done() or not self._asked.result().accepted:
            return False
        if any(result.done() for result in self._results):
            return False
        self._results.append(self._asked.result().get_result_async())
        return True

    def accepted(self, asked):
        """Return the handle of a goal."""
        self._r.w.until(asked.done)
        assert asked.result().accepted
        return asked.result()

    def ended(self, handle):
        """Wait for the end of a goal; return status of the action, code of the result."""
        found = self._r.w.ask(handle.get_result_async)
        return found.status, found.result.code


class Trajectories:
    """Sends the rollers on trajectories from where they are."""

    def __init__(self, r):
        self._r = r
        topic = 'joint_trajectory_controller/joint_trajectory'
        self._publisher = r.w.probe.create_publisher(JointTrajectory, topic, 1)

    def send(self, travel):
        """Send a trajectory."""
        begin = self._r.travel()
        points = [
            JointTrajectoryPoint(positions=(begin + share * travel).tolist())
            for share in (0.0, 1.0)
        ]
        points[1].time_from_start = Duration(sec=round(20.0 * np.abs(travel).max()))
        names = list(ROBOT.roller_names)
        self._publisher.publish(JointTrajectory(joint_names=names, points=points))

    def go(self, travel):
        """Send a trajectory until the rollers move."""
        w = self._r.w
        w.until(lambda: self._publisher.get_subscription_count() > 0)
        w.until(lambda: w.probe.last('joints') is not None)
        w.until(self._r.moving, lambda: self.send(travel), period=0.5)

    def arrive(self, travel):
        """Send trajectories until one is followed to its end; one from an old place is refused."""
        w = self._r.w
        self.go(travel)

        def each():
            if w.code() == Status.HALT_TRAJECTORY and not self._r.moving():
                self.send(travel)

        w.until(lambda: w.code() == Status.ARRIVED, each, period=2.0)


def test_a_path_ends_with_its_node_and_the_next_one_works(tmp_path):
    with robot(tmp_path) as r:
        w, paths = r.w, Paths(r)
        for name in ('simulator', 'manipulation', 'path_follower'):
            r.start(name, **PATIENT)
        w.until(lambda: w.code() == Status.HALT_NO_TWIST)
        paths.go(0.2)
        r.signal('path_follower', signal.SIGKILL)
        r.check_rests()
        assert w.code() == Status.HALT_NO_TWIST
        r.start('path_follower', **PATIENT)
        w.probe.seen['diagnostics'].clear()
        w.until(lambda: bool(w.report('path_follower').name))
        r.check_rests()  # nobody goes on with the old path
        status, code = paths.ended(paths.go(0.01))
        assert (status, code) == (GoalStatus.STATUS_SUCCEEDED, Result.REACHED)


def test_a_path_is_cancelled_or_preempted_by_another_process(tmp_path):
    with robot(tmp_path) as r:
        w, paths = r.w, Paths(r)
        for name in ('simulator', 'manipulation', 'path_follower'):
            r.start(name, **PATIENT)
        w.until(lambda: w.code() == Status.HALT_NO_TWIST)
        # So slowly that the next path still begins where the object is when it is asked for.
        first = paths.go(0.2, speed=0.001)
        second = paths.accepted(paths.ask(-0.2))
        assert paths.ended(first) == (GoalStatus.STATUS_ABORTED, Result.PREEMPTED)
        # The object goes the other way now.
        high = w.probe.last('pose').pose.position.y
        w.until(lambda: w.probe.last('pose').pose.position.y < high)
        # Who does not pursue it any more cannot be told to stop.
        late = first.cancel_goal_async()
        w.until(late.done)
        assert not late.result().goals_canceling
        w.until(r.moving)
        asked = second.cancel_goal_async()
        w.until(asked.done)
        assert len(asked.result().goals_canceling) == 1
        assert paths.ended(second) == (GoalStatus.STATUS_CANCELED, Result.CANCELLED)
        r.check_rests()
        status, code = paths.ended(paths.go(0.01))
        assert (status, code) == (GoalStatus.STATUS_SUCCEEDED, Result.REACHED)


def test_a_trajectory_ends_with_its_node_and_the_next_one_works(tmp_path):
    with robot(tmp_path) as r:
        w, trajectories = r.w, Trajectories(r)
        r.start('simulator', **PATIENT)
        r.start('manipulation', **PATIENT)
        trajectories.go(np.full(N, 0.2))
        r.signal('manipulation', signal.SIGKILL)
        r.check_rests()
        r.start('manipulation', **PATIENT)
        w.until(lambda: w.code() == Status.HALT_NO_TWIST)
        r.check_rests()
        trajectories.arrive(np.full(N, -0.05))


def test_an_emergency_stop_of_another_process_ends_a_trajectory(tmp_path):
    with robot(tmp_path) as r:
        w, trajectories = r.w, Trajectories(r)
        release = w.probe.create_client(Trigger, 'release_emergency_stop')
        r.start('simulator', **PATIENT)
        r.start('manipulation', **PATIENT)
        trajectories.go(np.full(N, 0.2))
        w.probe.stops.publish(Bool(data=True))
        w.probe.stops.publish(Bool(data=False))
        r.check_rests()
        # The drives are told to stop; they do not merely miss commands.
        assert not w.command().any()
        w.until(lambda: w.code() == Status.HALT_EMERGENCY_STOP)
        at = r.travel()
        trajectories.send(np.full(N, 0.05))
        r.check_rests()
        assert np.array_equal(r.travel(), at)
        assert w.call(release, Trigger.Request()).success
        w.until(lambda: w.code() == Status.HALT_TRAJECTORY)
        r.check_rests()
        trajectories.arrive(np.full(N, -0.05))
