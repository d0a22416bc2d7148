# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the tests of the search for grasps share: goals, a client, and the processes."""

import contextlib

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.action import PlanGrasp
from isotruss_ros.nodes.grasp_planner import GraspPlanner
import numpy as np
from probe import maker
import psutil

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


def workers(of=None):
    """Return the processes that search, of this process or another."""
    found = []
    for child in psutil.Process(of).children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):
            if 'spawn_main' in ' '.join(child.cmdline()):
                found.append(child)
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
