"""Start the simulator and the manipulation node together: no hardware needed."""

from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchDescription

ARGUMENTS = {
    'robot': ('nine_member', str, 'Preset, or path of a robot file'),
    'grip_module': ('north/Z', str, 'Module t/j whose two sides hold the object'),
    'object_diameter': ('0.3', float, "The object's own diameter [m]"),
    'rate': ('200.0', float, 'Cycles per second of both nodes [Hz]'),
    'command_timeout': ('0.2', float, 'Inputs older than this stop the rollers [s]'),
}


def generate_launch_description() -> LaunchDescription:
    """Return both nodes with the parameters that they share."""
    shared = {
        name: ParameterValue(LaunchConfiguration(name), value_type=kind)
        for name, (_, kind, _) in ARGUMENTS.items()
    }
    stamped = ParameterValue(LaunchConfiguration('use_stamped_twist'), value_type=bool)
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=description)
                for name, (default, _, description) in ARGUMENTS.items()
            ),
            DeclareLaunchArgument(
                'use_stamped_twist',
                default_value='false',
                description='cmd_vel is a TwistStamped instead of a Twist',
            ),
            Node(package='isotruss_ros', executable='simulator', parameters=[shared]),
            Node(
                package='isotruss_ros',
                executable='manipulation',
                parameters=[shared | {'use_stamped_twist': stamped}],
            ),
        ]
    )
