"""Start what moves and watches a held object, for drivers that run under ros2_control."""

from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchDescription

#: What all nodes share; what describes the real robot has no default.
ALL = {
    'robot': (None, str, 'Preset, or path of a robot file'),
    'command_timeout': ('0.2', float, 'Inputs older than this are not relied on [s]'),
    'autostart': ('true', bool, 'Nodes configure and activate on their own'),
    'use_sim_time': ('false', bool, 'Go by the topic /clock'),
}
STAMPED = {
    'use_stamped_twist': ('false', bool, 'cmd_vel is a TwistStamped instead of a Twist'),
}
#: What all share that know the object.
SHARED = ALL | {
    'object_diameter': (None, float, "The object's own diameter [m]"),
}
MANIPULATION = SHARED | {
    'grip_module': (None, str, 'Module t/j whose two sides hold the object'),
    'rate': ('200.0', float, 'Cycles per second of the manipulation [Hz]'),
    **STAMPED,
    'require_emergency_stop': ('false', bool, 'Nothing moves before emergency_stop is heard'),
}
GRASP_ANALYSIS = SHARED | {
    'friction': ('0.5', float, 'Coefficient of friction between tube and object'),
}
NODES = {
    'manipulation': MANIPULATION,
    'grasp_analysis': GRASP_ANALYSIS,
    'path_follower': ALL | STAMPED,
    'grasp_planner': ALL,
}


def generate_launch_description() -> LaunchDescription:
    """Return the nodes; an argument goes to all that have the parameter."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=description)
                for name, (default, _, description) in (MANIPULATION | GRASP_ANALYSIS).items()
            ),
            *(
                Node(
                    package='isotruss_ros',
                    executable=executable,
                    parameters=[
                        {
                            name: ParameterValue(LaunchConfiguration(name), value_type=kind)
                            for name, (_, kind, _) in arguments.items()
                        }
                    ],
                )
                for executable, arguments in NODES.items()
            ),
        ]
    )
