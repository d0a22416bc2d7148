# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Start the nodes that move and analyse a held object, for drivers that run under ros2_control."""

from pathlib import Path

from isotruss_ros.nodes.framework.launching import describe_launch
from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Return the nodes; the arguments that describe robot and object have no default."""
    return describe_launch(
        Path(__file__).parent, required=('robot', 'object_diameter', 'grip_module')
    )
