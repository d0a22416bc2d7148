# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Start the simulator and the nodes that move and analyse a held object: no hardware needed."""

from pathlib import Path

from isotruss_ros.nodes.framework.launching import describe_launch
from launch import LaunchDescription

DEFAULTS = {'command_timeout': 1.0, 'plant': 'elastic', 'indentation': 0.005, 'friction': 0.8}


def generate_launch_description() -> LaunchDescription:
    """Return the nodes; all parameters of the simulator are arguments."""
    return describe_launch(Path(__file__).parent, simulated=True, defaults=DEFAULTS)
