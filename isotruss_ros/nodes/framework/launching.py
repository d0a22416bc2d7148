# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Launch descriptions that have all parameters of their nodes as arguments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from isotruss_ros.core.errors import suggest
from isotruss_ros.nodes.framework.parameters import ParameterError, Spec, Value
from isotruss_ros.nodes.framework.runner import find_node
from launch import LaunchContext, LaunchDescription  # type: ignore[attr-defined]
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

USE_SIM_TIME = Spec('use_sim_time', False, 'Whether the topic /clock defines the time')
NAMESPACE, PARAMETERS = 'namespace', 'parameters'
#: Parameters of the nodes that are launch arguments, in addition to `use_sim_time` and all
#: parameters of the simulator.
ARGUMENTS = (
    'robot',
    'command_timeout',
    'autostart',
    'object_diameter',
    'object',
    'obstacles',
    'friction',
    'grip_module',
    'grip',
    'rate',
    'use_stamped_twist',
    'require_emergency_stop',
    'port',
)
#: Default of the launch argument that starts each node; None: the node is always started.
NODES = {
    'manipulation': None,
    'grasp_analysis': None,
    'path_follower': True,
    'grasp_planner': True,
    'pick_and_place': True,
    'state_estimator': False,
    'viewer': False,
}


def describe_launch(
    folder: Path,
    simulated: bool = False,
    required: Sequence[str] = (),
    defaults: Mapping[str, Value] = MappingProxyType({}),
) -> LaunchDescription:
    """
    Return the launch description of the nodes, with a launch argument for each parameter.

    If one node ends, all nodes are shut down, because with the remaining nodes the robot would
    seem to work. If a parameter file is missing, the launch ends before a node starts.
    """
    file = folder.parent / 'config' / 'nodes' / 'parameters.yaml'
    arguments = {
        NAMESPACE: Spec(
            NAMESPACE, '', 'Namespace of all nodes and topics, to distinguish several robots'
        ),
        PARAMETERS: Spec(
            PARAMETERS, str(file), 'File with the parameters that are not launch arguments'
        ),
        USE_SIM_TIME.name: USE_SIM_TIME,
    }
    started = []
    for executable in ('simulator', *NODES) if simulated else NODES:
        declared, kind = [USE_SIM_TIME], find_node(executable)
        for spec in (*kind.base_specs, *kind.specs):
            if executable == 'simulator' or spec.name in ARGUMENTS:
                shared = arguments.setdefault(spec.name, spec)
                if shared.default == spec.default:  # the viewer has another rate, for example
                    declared.append(spec)
        started.append(_describe_node(executable, declared))
    declared = [
        _declare(
            spec.name,
            None if spec.name in required else defaults.get(spec.name, spec.default),
            spec.description,
        )
        for spec in arguments.values()
    ]
    switches = {name: start for name, start in NODES.items() if start is not None}
    for name, start in switches.items():
        declared.append(_declare(name, start, f'Whether the node {name} is started'))
    known = arguments.keys() | switches.keys()
    check = OpaqueFunction(function=lambda context: _check_arguments(context, known))
    return LaunchDescription([*declared, check, *started])


def _declare(name: str, default: Value | None, description: str) -> DeclareLaunchArgument:
    """Return a launch argument, which is required if it has no default."""
    text = str(default).lower() if isinstance(default, bool) else str(default)
    return DeclareLaunchArgument(
        name, default_value=None if default is None else text, description=description
    )


def _describe_node(executable: str, specs: Sequence[Spec]) -> Node:
    parameters = {}
    for spec in specs:
        default = spec.default
        kind: type = type(default)
        if isinstance(default, list):
            kind = list[float] if isinstance(default[0], float) else list[str]
        substitution = LaunchConfiguration(spec.name)
        parameters[spec.name] = ParameterValue(substitution, value_type=kind)
    optional = NODES.get(executable) is not None
    return Node(
        package='isotruss_ros',
        executable=executable,
        namespace=LaunchConfiguration(NAMESPACE),
        parameters=[LaunchConfiguration(PARAMETERS), parameters],
        condition=IfCondition(LaunchConfiguration(executable)) if optional else None,
        on_exit=Shutdown(reason=f'{executable} ended'),
    )


def _check_arguments(context: LaunchContext, known: set[str]) -> list[LogInfo]:
    """Return warnings about unknown arguments; raise an error if the parameter file is missing."""
    file = context.launch_configurations[PARAMETERS]
    if not Path(file).is_file():
        # launch would warn and start the nodes with their defaults.
        raise ParameterError(f'launch argument {PARAMETERS}: {file}: no such file')
    named = {argument.partition(':=')[0] for argument in context.argv}
    unknown = {name: f'{suggest(name, known)}see --show-args' for name in sorted(named - known)}
    return [
        LogInfo(msg=f'launch argument {name}: unknown, and not used; {hint}')
        for name, hint in unknown.items()
    ]
