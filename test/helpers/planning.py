# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the tests of the search for grasps share: goals, a client, and the processes."""

import contextlib

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.action import PlanGrasp
from isotruss_ros.nodes.grasp_planner import GraspPlanner
from probe import maker
import psutil

CENTER, DIAMETER = (0.716, 0.43), 0.3
#: No grasp has such a margin [N]: the search for it goes on for a long time.
NO_MARGIN = 1e3
#: A busy machine does not confuse it.
node = maker(GraspPlanner, command_timeout=5.0)


def goal(center=CENTER, frame='truss', **fields):
    pose = PoseStamped()
    pose.header.frame_id = frame
    pose.pose.position.x, pose.pose.position.y = center
    return PlanGrasp.Goal(**({'object_pose': pose, 'object_diameter': DIAMETER} | fields))


def workers(of=None):
    """Return the processes that search, of this process or another."""
    result = []
    for child in psutil.Process(of).children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):
            if 'spawn_main' in ' '.join(child.cmdline()):
                result.append(child)
    return result
