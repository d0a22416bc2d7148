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

from isotruss_ros.nodes.components.launching import describe_launch
from launch import LaunchDescription

DEFAULTS = {'command_timeout': 1.0, 'plant': 'elastic', 'indentation': 0.01, 'friction': 0.8}


def generate_launch_description() -> LaunchDescription:
    """Return the nodes; all parameters of the simulator are arguments."""
    return describe_launch(Path(__file__).parent, simulated=True, defaults=DEFAULTS)
