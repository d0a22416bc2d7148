# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Start the simulator and the nodes that move and analyse a held object: no hardware needed."""

from pathlib import Path

from isotruss_ros.nodes import simulator, viewer
from isotruss_ros.nodes.components import common_parameters as common
from isotruss_ros.nodes.components import simulated_object
from isotruss_ros.nodes.components.launching import describe_launch
from launch import LaunchDescription

# The object is held by the tubes at the start: pressed into a corner of 60 degrees, in which it
# rests by friction only with a coefficient of 0.58 or more. Nothing is hurt where a machine that
# is busy is late.
DEFAULTS = {
    common.COMMAND_TIMEOUT: 1.0,
    simulator.PLANT: simulator.ELASTIC,
    simulated_object.INDENTATION: 0.01,
    common.FRICTION: 0.8,
}


def generate_launch_description() -> LaunchDescription:
    """Return the nodes; all parameters of the simulator are arguments."""
    return describe_launch(
        Path(__file__).parent,
        {
            'simulator': simulator.SPECS,
            'manipulation': (
                common.OBJECT_DIAMETER,
                common.OBJECT,
                common.GRIP_MODULE,
                common.GRIP,
                common.RATE,
                common.FRICTION,
                common.USE_STAMPED_TWIST,
                common.REQUIRE_EMERGENCY_STOP,
            ),
            'grasp_analysis': (*common.OBJECT_SPECS, common.RATE),
            'path_follower': (*common.OBJECT_SPECS, common.USE_STAMPED_TWIST, common.RATE),
            'grasp_planner': (common.OBJECT,),
            'pick_and_place': common.OBJECT_SPECS,
            'state_estimator': (
                common.OBJECT_DIAMETER,
                common.OBJECT,
                common.GRIP_MODULE,
                common.GRIP,
            ),
            'viewer': (*common.OBJECT_SPECS, viewer.PORT),
        },
        defaults=DEFAULTS,
    )
