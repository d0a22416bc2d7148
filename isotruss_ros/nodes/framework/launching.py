"""Launch descriptions whose arguments are parameters of the nodes, as these declare them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from isotruss_ros.nodes.framework.parameters import (
    AUTOSTART,
    COMMAND_TIMEOUT,
    ROBOT,
    Spec,
    Value,
)
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

USE_SIM_TIME = Spec('use_sim_time', False, 'Time comes from the topic /clock')
#: Arguments of every launch file, for all its nodes.
SHARED = (ROBOT, COMMAND_TIMEOUT, AUTOSTART, USE_SIM_TIME)


def describe_launch(
    nodes: Mapping[str, Sequence[Spec]], required: Sequence[Spec] = ()
) -> LaunchDescription:
    """
    Return nodes, and arguments that go to all nodes that have the parameter.

    :param nodes: by executable, the parameters that are arguments, besides the shared ones.
    :param required: arguments without default.
    """
    given = {executable: (*SHARED, *specs) for executable, specs in nodes.items()}
    arguments = {spec.name: spec for specs in given.values() for spec in specs}
    without_default = {spec.name for spec in required}
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(
                    name,
                    default_value=None if name in without_default else _to_text(spec.default),
                    description=spec.description,
                )
                for name, spec in arguments.items()
            ),
            *(
                Node(
                    package='isotruss_ros',
                    executable=executable,
                    parameters=[
                        {
                            spec.name: ParameterValue(
                                LaunchConfiguration(spec.name), value_type=type(spec.default)
                            )
                            for spec in specs
                        }
                    ],
                )
                for executable, specs in given.items()
            ),
        ]
    )


def _to_text(value: Value) -> str:
    """Return a default as launch reads it."""
    return str(value).lower() if isinstance(value, bool) else str(value)
