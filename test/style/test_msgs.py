# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The messages of msg_defs are generated and able to travel; test_docs compares their fields."""

import math

from isotruss_msgs.msg import Contact, GraspState
from rclpy.serialization import deserialize_message, serialize_message


def test_grasps_survive_serialization():
    state = GraspState(contacts=[Contact(normal_force=2.0)], required_friction=math.inf)
    state.stiffness[8] = 3.0
    state.contact_members, state.contact_lengths = ['north/Z-R'], [0.005]
    assert deserialize_message(serialize_message(state), GraspState) == state
