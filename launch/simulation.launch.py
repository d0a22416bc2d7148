"""Start the simulator and the nodes that move and analyse a held object: no hardware needed."""

from isotruss_ros.nodes.framework import parameters as params
from isotruss_ros.nodes.framework.launching import describe_launch
from isotruss_ros.nodes.simulator import INDENTATION
from launch import LaunchDescription

MOTION = (params.OBJECT_DIAMETER, params.GRIP_MODULE, params.RATE)


def generate_launch_description() -> LaunchDescription:
    """Return the nodes; the grasp analysis and the path follower have rates of their own."""
    return describe_launch(
        {
            'simulator': (*MOTION, INDENTATION),
            'manipulation': (*MOTION, params.USE_STAMPED_TWIST, params.REQUIRE_EMERGENCY_STOP),
            'grasp_analysis': (params.OBJECT_DIAMETER, params.FRICTION),
            'path_follower': (params.USE_STAMPED_TWIST,),
            'grasp_planner': (),
        }
    )
