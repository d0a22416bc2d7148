"""The messages of msg_defs are generated, complete and able to travel."""

from isotruss_msgs.msg import ManipulationStatus
from rclpy.serialization import deserialize_message, serialize_message

# Users write these numbers into scripts and bags keep them: they must not change.
CODES = {
    'OK': 0,
    'IDLE': 1,
    'SLOWED_ROLLER_SPEED': 10,
    'SLOWED_MEMBER_LENGTH': 11,
    'UNREACHABLE': 20,
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
}


def test_codes_keep_their_numbers():
    assert {name: getattr(ManipulationStatus, name) for name in CODES} == CODES


def test_fields_are_those_that_clients_read():
    assert ManipulationStatus.get_fields_and_field_types() == {
        'header': 'std_msgs/Header',
        'code': 'uint8',
        'message': 'string',
        'commanded': 'geometry_msgs/Twist',
        'achieved': 'geometry_msgs/Twist',
        'scale': 'double',
        'cycle_time': 'double',
    }


def test_status_survives_serialization():
    status = ManipulationStatus(code=ManipulationStatus.UNREACHABLE, message='über', scale=0.25)
    status.header.frame_id = 'truss'
    status.achieved.linear.y = -0.125
    assert deserialize_message(serialize_message(status), ManipulationStatus) == status
