# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The manipulation node with objects and grips of any members, its inputs faked."""

from boxes import BOX, box_between, SIDES
from geometry_msgs.msg import PoseStamped
from isotruss_ros.core import Pose, Status
from isotruss_ros.nodes.conversions.messages import make_header, to_pose_message
from isotruss_ros.nodes.manipulation import Manipulation
from manual_world import world
import numpy as np
from probe import maker, overrides
import pytest

TWIST = (0.01, 0.01, 0.0)


#: The robot holds the box between two sides.
node = maker(Manipulation, failure_time=0.0, object=BOX, grip=list(SIDES), command_timeout=5.0)


def send(w, twist=TWIST, moved=(0.0, 0.0, 0.0)):
    """Return a call that publishes the box in its grip, and a twist."""

    def publish():
        pose = Pose(*(np.array(box_between().body.pose) + moved))
        message = PoseStamped(pose=to_pose_message(pose))
        message.header = make_header(w.probe.past(0.0), 'truss')
        w.probe.send_joints()
        w.probe.object_poses.publish(message)
        w.probe.send_twist(twist)

    return publish


def test_moves_the_box_and_halts_where_the_grip_is_another():
    with world(node()) as w:
        status = w.until_code(Status.OK, send(w))
        assert status.achieved.linear.x == pytest.approx(TWIST[0], abs=1e-9)
        assert status.achieved.linear.y == pytest.approx(TWIST[1], abs=1e-9)
        assert status.reachable_dof == 3
        manipulation = w.nodes[1]
        assert manipulation.details()['grip'] == ', '.join(SIDES)
        w.until_code(Status.HALT_NO_GRASP, send(w, moved=(0.0, 0.5, 0.0)))
        w.until_code(Status.OK, send(w))
        # Which members hold it can be changed while the node runs.
        (done,) = manipulation.set_parameters(overrides(grip=['south/P-Q', 'east/R-Y']))
        assert done.successful
        status = w.until_code(Status.HALT_NO_GRASP, send(w))
        assert 'does not touch' in status.message
        (refused,) = manipulation.set_parameters(overrides(grip=['south/P-Q']))
        assert not refused.successful
        assert 'two or three different members' in refused.reason
