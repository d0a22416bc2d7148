# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the tests of the search for grasps share: goals, a client, and the processes."""

import contextlib
import time

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.action import PlanGrasp
from isotruss_ros.nodes.grasp_planner import GraspPlanner
import numpy as np
from probe import maker
import psutil
from rclpy.action import ActionClient

CENTER, DIAMETER = (0.716, 0.43), 0.3
#: No grasp has such a margin [N]: the search for it goes on for a long time.
NO_MARGIN = 1e3


#: A busy machine does not confuse it.
node = maker(GraspPlanner, command_timeout=5.0)


def goal(center=CENTER, frame='truss', **fields):
    """Return a goal."""
    pose = PoseStamped()
    pose.header.frame_id = frame
    pose.pose.position.x, pose.pose.position.y = center
    return PlanGrasp.Goal(**({'object_pose': pose, 'object_diameter': DIAMETER} | fields))


class Client:
    """
    Asks as any action client does, while joint states come all the time.

    :param w: the world.
    """

    def __init__(self, w, positions=None):
        self.feedback = []
        self._world = w
        self._joints = {} if positions is None else {'position': list(positions)}
        self._client = ActionClient(w.probe, PlanGrasp, 'plan_grasp')
        self.until(self._client.server_is_ready)
        # The node has heard of the rollers when it says so.
        self.until(lambda: w.nodes[1]._shape.rollers is not None)

    def until(self, what):
        """Spin until something holds."""
        self._world.until(what, lambda: self._world.probe.send_joints(**self._joints), 0.02)

    def send(self, asked):
        """Send a goal and return its handle."""
        self.feedback = []
        future = self._client.send_goal_async(
            asked, lambda message: self.feedback.append((time.monotonic(), message.feedback))
        )
        self.until(future.done)
        return future.result()

    def begin(self, asked):
        """Send a goal and wait until candidates are looked at."""
        handle = self.send(asked)
        assert handle.accepted
        self.until(lambda: self.feedback and self.feedback[-1][1].evaluations > 0)
        return handle

    def result(self, handle):
        """Return how it ended: status of the action, result."""
        future = handle.get_result_async()
        self.until(future.done)
        return future.result().status, future.result().result

    def plan(self, asked):
        """Send a goal and wait for its end."""
        handle = self.send(asked)
        assert handle.accepted
        return self.result(handle)


def workers(of=None):
    """Return the processes that search, of this process or another."""
    found = []
    for child in psutil.Process(of).children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):
            if 'spawn_main' in ' '.join(child.cmdline()):
                found.append(child)
    return found


def begun_workers(count, of=None, deadline=20.0):
    """Return the processes that search once there are so many: a fork is none before its exec."""
    end = time.monotonic() + deadline
    while len(found := workers(of)) < count:
        assert time.monotonic() < end
        time.sleep(0.01)
    return found


def assert_same(found, expected):
    """Check that a result says to the last digit what a plan says."""
    assert (found.evaluations, found.analyses) == (expected.evaluations, expected.analyses)
    assert len(found.grasps) == len(expected.grasps) > 0
    for one, other in zip(found.grasps, expected.grasps, strict=True):
        assert one.module == (other.module or '')
        assert tuple(one.members) == other.members
        rows = np.array([point.positions for point in one.path.points])
        assert np.array_equal(rows, other.path)
        assert np.array_equal(one.roller_positions, other.path[-1])
        for name in (
            'score',
            'closure_margin',
            'required_friction',
            'max_contact_force',
            'total_force',
            'travel',
            'rigidity',
        ):
            assert getattr(one, name) == getattr(other, name), name
