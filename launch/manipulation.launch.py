"""Start the manipulation node for a robot whose drivers run under ros2_control."""

from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchDescription

ARGUMENTS = {
    'robot': (None, str, 'Preset, or path of a robot file'),
    'grip_module': (None, str, 'Module t/j whose two sides hold the object'),
    'object_diameter': (None, float, "The object's own diameter [m]"),
    'rate': ('200.0', float, 'Cycles per second [Hz]'),
    'command_timeout': ('0.2', float, 'Inputs older than this stop the rollers [s]'),
    'use_stamped_twist': ('false', bool, 'cmd_vel is a TwistStamped instead of a Twist'),
}


def generate_launch_description() -> LaunchDescription:
    """Return the node; what describes the real robot has no default."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=description)
                for name, (default, _, description) in ARGUMENTS.items()
            ),
            Node(
                package='isotruss_ros',
                executable='manipulation',
                parameters=[
                    {
                        name: ParameterValue(LaunchConfiguration(name), value_type=kind)
                        for name, (_, kind, _) in ARGUMENTS.items()
                    }
                ],
            ),
        ]
    )
