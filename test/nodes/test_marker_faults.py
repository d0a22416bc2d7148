# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""Markers that a tracker delivers late, out of order, swapped or not at all, over DDS."""

from isotruss_msgs.msg import StateEstimate
from isotruss_ros.nodes.simulator import Simulator
from isotruss_ros.nodes.state_estimator import StateEstimatorNode
import numpy as np
from probe import overrides, ROBOT, world
import pytest
from sensor_msgs.msg import MultiDOFJointState

GRASPED = {'friction': 0.9, 'indentation': 0.02, 'zero_deviation': 0.01, 'seed': 2}
#: Of the messages that are kept, one of so many has each of the faults.
EVERY, TURN = 5, 8


class BadTracker:
    """
    Passes every fifth true message on, each eighth of these with one of the faults.

    :param w: the world, whose simulator tells the truth.
    """

    def __init__(self, w):
        self._markers = w.probe.create_publisher(MultiDOFJointState, 'joint_markers', 10)
        w.probe.create_subscription(MultiDOFJointState, 'truth/joint_markers', self._take, 10)
        self._count = 0
        self._late = []

    def _take(self, message):
        self._count += 1
        turn, kept = divmod(self._count, EVERY)
        if kept:
            return
        fault = turn % TURN
        if fault == 1:  # late, and so out of order
            self._late.append(message)
        elif fault == 2:
            p, q = map(message.joint_names.index, ('P', 'Q'))
            places = message.transforms
            places[p], places[q] = places[q], places[p]
            self._markers.publish(message)
        elif fault == 3:
            del message.joint_names[2:], message.transforms[2:]
            self._markers.publish(message)
        elif fault != 4:  # which is missing altogether
            self._markers.publish(message)
            while self._late:
                self._markers.publish(self._late.pop())


@pytest.mark.parametrize('plant', ['elastic', 'mujoco'])
def test_joints_are_found_by_markers_late_swapped_or_missing(plant):
    simulated = overrides(plant=plant, **GRASPED)
    with world(lambda: Simulator(simulated), StateEstimatorNode) as w:
        w.probe.listen(StateEstimate, 'estimate', 'state_estimate')
        w.probe.listen(MultiDOFJointState, 'truth', 'truth/joint_markers')
        tracker = BadTracker(w)
        left_out = set()

        def off():
            """Return how far the worst joint of the estimate is from the truth [m]."""
            found, truth = w.probe.last('estimate'), w.probe.last('truth')
            if found is None or truth is None:
                return np.inf
            left_out.update(found.left_out_joints)
            joints = np.array([(joint.x, joint.y) for joint in found.joints])
            places = [(each.translation.x, each.translation.y) for each in truth.transforms]
            return np.abs(joints - places).max()

        count = len(ROBOT.topology.joint_names)
        w.until(lambda: off() < 2e-3 and len(w.probe.last('estimate').used_joints) == count)
        told = tracker._count + 40 * EVERY
        worst = []
        w.until(lambda: worst.append(off()) or tracker._count > told)
    assert max(worst) < 4e-3
    assert {'P', 'Q'} <= left_out
