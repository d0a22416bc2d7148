"""Start simulator and all that moves and watches a held object: no hardware needed."""

from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchDescription

#: What all nodes share.
ALL = {
    'robot': ('nine_member', str, 'Preset, or path of a robot file'),
    'command_timeout': ('0.2', float, 'Inputs older than this are not relied on [s]'),
    'autostart': ('true', bool, 'Nodes configure and activate on their own'),
    'use_sim_time': ('false', bool, 'Go by the topic /clock'),
}
STAMPED = {
    'use_stamped_twist': ('false', bool, 'cmd_vel is a TwistStamped instead of a Twist'),
}
#: What all share that know the object.
SHARED = ALL | {
    'object_diameter': ('0.3', float, "The object's own diameter [m]"),
}
#: What simulator and manipulation share; the grasp analysis has its own rate.
MOTION = SHARED | {
    'grip_module': ('north/Z', str, 'Module t/j whose two sides hold the object'),
    'rate': ('200.0', float, 'Cycles per second of simulator and manipulation [Hz]'),
}
SIMULATOR = MOTION | {
    'squeeze': ('0.0', float, 'How much nearer to the corner the object is than snug [m]'),
}
MANIPULATION = MOTION | {
    **STAMPED,
    'require_emergency_stop': ('false', bool, 'Nothing moves before emergency_stop is heard'),
}
GRASP_ANALYSIS = SHARED | {
    'friction': ('0.5', float, 'Coefficient of friction between tube and object'),
}
NODES = {
    'simulator': SIMULATOR,
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
                for name, (default, _, description) in (
                    SIMULATOR | MANIPULATION | GRASP_ANALYSIS
                ).items()
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
