# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The messages of msg_defs are generated, complete and able to travel."""

import math

from isotruss_msgs.msg import Contact, ConvexObject, GraspState, ManipulationStatus
from isotruss_msgs.srv import AnalyzeGrasp
from rclpy.serialization import deserialize_message, serialize_message

# Users write these numbers into scripts and bags keep them: they must not change.
CODES = {
    'OK': 0,
    'IDLE': 1,
    'SLOWED_ROLLER_SPEED': 10,
    'SLOWED_MEMBER_LENGTH': 11,
    'SLOWED_RIGIDITY': 12,
    'SLOWED_SELF_COLLISION': 13,
    'SLOWED_OBJECT': 14,
    'UNREACHABLE': 20,
    'SLIDING': 21,
    'HALT_NO_TWIST': 30,
    'HALT_INVALID_TWIST': 31,
    'HALT_NO_JOINT_STATES': 32,
    'HALT_STALE_JOINT_STATES': 33,
    'HALT_INVALID_JOINT_STATES': 34,
    'HALT_NO_OBJECT_POSE': 35,
    'HALT_STALE_OBJECT_POSE': 36,
    'HALT_INVALID_OBJECT_POSE': 37,
    'HALT_NO_GRASP': 38,
    'HALT_KINEMATICS': 39,
    'HALT_EMERGENCY_STOP': 40,
    'HALT_CLOCK': 41,
    'HALT_INVALID_FAILED_ROLLERS': 42,
}

GRASP_CODES = {
    'OK': 0,
    'WRINKLED': 1,
    'NO_JOINT_STATES': 10,
    'STALE_JOINT_STATES': 11,
    'INVALID_JOINT_STATES': 12,
    'NO_OBJECT_POSE': 20,
    'STALE_OBJECT_POSE': 21,
    'INVALID_OBJECT_POSE': 22,
    'STALE_EXTERNAL_WRENCH': 31,
    'INVALID_EXTERNAL_WRENCH': 32,
    'NO_CONFIGURATION': 40,
    'MECHANISM': 41,
    'NOT_SOLVED': 42,
    'INVALID_REQUEST': 50,
}


def test_codes_keep_their_numbers():
    shapes = {'NONE': 0, 'DISC': 1, 'POLYGON': 2, 'ELLIPSE': 3}
    assert {name: getattr(ConvexObject, name) for name in shapes} == shapes
    assert {name: getattr(ManipulationStatus, name) for name in CODES} == CODES
    assert {name: getattr(GraspState, name) for name in GRASP_CODES} == GRASP_CODES


def test_fields_are_those_that_clients_read():
    assert ManipulationStatus.get_fields_and_field_types() == {
        'header': 'std_msgs/Header',
        'code': 'uint8',
        'message': 'string',
        'commanded': 'geometry_msgs/Twist',
        'achieved': 'geometry_msgs/Twist',
        'scale': 'double',
        'cycle_time': 'double',
        'failed_rollers': 'sequence<string>',
        'reachable_dof': 'uint8',
    }
    assert GraspState.get_fields_and_field_types() == {
        'header': 'std_msgs/Header',
        'code': 'uint8',
        'message': 'string',
        'held': 'boolean',
        'hold_message': 'string',
        'slip_margin': 'double',
        'displacement': 'double[3]',
        'grasping_members': 'sequence<string>',
        'squeeze': 'sequence<double>',
        'friction_used': 'sequence<double>',
        'force_closure': 'boolean',
        'closure_residual': 'double',
        'closure_tolerance': 'double',
        'required_friction': 'double',
        'closure_margin': 'double',
        'normal_wrench': 'geometry_msgs/Wrench',
        'contacts': 'sequence<isotruss_msgs/Contact>',
        'contact_members': 'sequence<string>',
        'contact_lengths': 'sequence<double>',
        'contact_widths': 'sequence<double>',
        'contact_areas': 'sequence<double>',
        'contact_pressures': 'sequence<double>',
        'peak_pressures': 'sequence<double>',
        'members': 'sequence<string>',
        'utilisation': 'sequence<double>',
        'utilisation_places': 'sequence<double>',
        'stiffness': 'double[9]',
        'computing_time': 'double',
    }
    assert Contact.get_fields_and_field_types() == {
        'position': 'geometry_msgs/Point',
        'normal': 'geometry_msgs/Vector3',
        'normal_force': 'double',
        'friction_force': 'double',
        'gap': 'double',
    }
    assert ConvexObject.get_fields_and_field_types() == {
        'shape': 'uint8',
        'diameter': 'double',
        'vertices': 'sequence<geometry_msgs/Point>',
        'corner_radii': 'sequence<double>',
        'semi_axes': 'double[2]',
        'mass': 'sequence<double, 1>',
        'center_of_mass': 'sequence<geometry_msgs/Point, 1>',
        'friction': 'sequence<double, 1>',
    }
    assert AnalyzeGrasp.Request.get_fields_and_field_types() == {
        'center': 'geometry_msgs/Point',
        'diameter': 'double',
        'object': 'isotruss_msgs/ConvexObject',
        'object_pose': 'geometry_msgs/Pose',
        'friction': 'double',
        'external_wrench': 'geometry_msgs/Wrench',
        'roller_positions': 'sequence<double>',
    }
    assert AnalyzeGrasp.Response.get_fields_and_field_types() == {
        'success': 'boolean',
        'message': 'string',
        'state': 'isotruss_msgs/GraspState',
    }


def test_grasps_survive_serialization():
    state = GraspState(contacts=[Contact(normal_force=2.0)], required_friction=math.inf)
    state.stiffness[8] = 3.0
    state.contact_members, state.contact_lengths = ['north/Z-R'], [0.005]
    assert deserialize_message(serialize_message(state), GraspState) == state


def test_status_survives_serialization():
    status = ManipulationStatus(code=ManipulationStatus.UNREACHABLE, message='über', scale=0.25)
    status.header.frame_id = 'truss'
    status.achieved.linear.y = -0.125
    assert deserialize_message(serialize_message(status), ManipulationStatus) == status
