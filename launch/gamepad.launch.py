# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Publish the sticks of a gamepad as twists on `cmd_vel`, by `joy` and `teleop_twist_joy`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

#: Left stick: translation [m/s]; right stick: rotation [rad/s]; both only while the button is
#: held.
TELEOP = {
    'require_enable_button': True,
    'enable_button': 4,
    'axis_linear.x': 0,
    'axis_linear.y': 1,
    'axis_angular.yaw': 3,
    'scale_linear.x': -0.03,  # left is positive on a stick
    'scale_linear.y': 0.03,
    'scale_angular.yaw': 0.2,
}
#: A stick that is held sends nothing new, so its message is repeated faster than `command_timeout`
#: [Hz].
JOY = {'autorepeat_rate': 20.0}


def generate_launch_description() -> LaunchDescription:
    """Return both nodes; if one ends, the other ends as well and the object stops."""
    arguments = [
        DeclareLaunchArgument('namespace', default_value='', description='Namespace of the robot'),
        DeclareLaunchArgument(
            'use_stamped_twist', default_value='false', description='As in `manipulation`'
        ),
    ]
    stamped = ParameterValue(LaunchConfiguration('use_stamped_twist'), value_type=bool)
    nodes = [
        Node(
            package=package,
            executable=executable,
            namespace=LaunchConfiguration('namespace'),
            parameters=[parameters],
            on_exit=Shutdown(reason=f'{executable} ended'),
        )
        for package, executable, parameters in (
            ('joy', 'joy_node', JOY),
            ('teleop_twist_joy', 'teleop_node', TELEOP | {'publish_stamped_twist': stamped}),
        )
    ]
    return LaunchDescription([*arguments, *nodes])
