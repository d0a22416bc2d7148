# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Find where the encoders read zero from markers on three joints."""

from isotruss_ros import core
from isotruss_ros.core.control.state_estimator import StateEstimator

robot = core.load_robot('nine_member')
true = robot.configuration([0.005] * 6)  # every encoder misses 5 mm of travel
joints = dict(zip(robot.topology.joint_names, true.nodes, strict=False))

estimator = StateEstimator(robot)
estimator.take_encoders(0.0, [0.0] * 6)
for _ in range(20):  # messages of markers, good to 1 mm
    estimator.take_markers(0.0, {name: joints[name] for name in 'QRZ'}, 1e-3)
print('to be added:', (1e3 * estimator.estimate().offsets).round(1), 'mm')
