# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Launch descriptions whose arguments are parameters of the nodes, as these declare them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from isotruss_ros.nodes.components.common_parameters import COMMAND_TIMEOUT, ROBOT
from isotruss_ros.nodes.framework.parameters import AUTOSTART, ParameterError, Spec, Value
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

USE_SIM_TIME = Spec('use_sim_time', False, 'Time comes from the topic /clock')
NAMESPACE, PARAMETERS = 'namespace', 'parameters'
#: Arguments of every launch file: for all its nodes, and for those that are managed.
SHARED, MANAGED = (ROBOT, USE_SIM_TIME), (COMMAND_TIMEOUT, AUTOSTART)
#: Nodes that are not managed.
UNMANAGED = ('viewer',)
#: Nodes that an argument of their name starts or leaves out, with its default.
OPTIONAL = {
    'path_follower': True,
    'grasp_planner': True,
    'pick_and_place': True,
    'state_estimator': False,
    'viewer': False,
}


def describe_launch(
    folder: Path,
    nodes: Mapping[str, Sequence[Spec]],
    required: Sequence[Spec] = (),
    defaults: Mapping[Spec, Value] = MappingProxyType({}),
) -> LaunchDescription:
    """
    Return nodes, and arguments that go to all nodes that have the parameter.

    All nodes are shut down when one of them ends: what is left would look like a robot that works.
    A file of parameters that is not there ends the launch before a node starts.

    :param folder: of the launch file; `config` stands beside it.
    :param nodes: by executable, the parameters that are arguments, besides the shared ones.
    :param required: arguments without default.
    :param defaults: of arguments whose default is not that of the nodes.
    """
    given = {
        executable: dict.fromkeys((*SHARED, *(() if executable in UNMANAGED else MANAGED), *specs))
        for executable, specs in nodes.items()
    }
    file = folder.parent / 'config' / 'nodes' / 'parameters.yaml'
    arguments = [
        _declare(NAMESPACE, '', 'Of all nodes and their topics, for several robots side by side'),
        _declare(PARAMETERS, str(file), 'File with the parameters that are no launch arguments'),
    ]
    for spec in dict.fromkeys(spec for specs in given.values() for spec in specs):
        default = None if spec in required else defaults.get(spec, spec.default)
        arguments.append(_declare(spec.name, default, spec.description))
    known = {spec.name for specs in given.values() for spec in specs} | {NAMESPACE, PARAMETERS}
    for executable in OPTIONAL.keys() & nodes.keys():
        words = f'Whether the node {executable} is started'
        arguments.append(_declare(executable, OPTIONAL[executable], words))
        known.add(executable)
    started = [_describe_node(executable, specs) for executable, specs in given.items()]
    check = OpaqueFunction(function=lambda context: _check_arguments(context, known))
    return LaunchDescription([*arguments, check, *started])


def _declare(name: str, default: Value | None, description: str) -> DeclareLaunchArgument:
    """Return an argument; one without default must be given."""
    text = str(default).lower() if isinstance(default, bool) else str(default)
    return DeclareLaunchArgument(
        name, default_value=None if default is None else text, description=description
    )


def _describe_node(executable: str, specs: Iterable[Spec]) -> Node:
    parameters = {
        spec.name: ParameterValue(
            LaunchConfiguration(spec.name), value_type=_type_of(spec.default)
        )
        for spec in specs
    }
    optional = executable in OPTIONAL
    return Node(
        package='isotruss_ros',
        executable=executable,
        namespace=LaunchConfiguration(NAMESPACE),
        parameters=[LaunchConfiguration(PARAMETERS), parameters],
        condition=IfCondition(LaunchConfiguration(executable)) if optional else None,
        on_exit=Shutdown(reason=f'{executable} ended'),
    )


def _type_of(value: Value) -> Any:
    """Return the type that launch reads from a text; all lists are of texts."""
    return list[str] if isinstance(value, list) else type(value)


def _check_arguments(context: LaunchContext, known: set[str]) -> list[LogInfo]:
    """Return warnings of unknown arguments; a file of parameters must be there."""
    file = context.launch_configurations[PARAMETERS]
    if not Path(file).is_file():
        # launch would warn, and start the nodes with their defaults.
        raise ParameterError(f'launch argument {PARAMETERS}: {file}: no such file')
    named = {argument.partition(':=')[0] for argument in context.argv}
    return [
        LogInfo(msg=f'launch argument {name}: unknown, and not used; see --show-args')
        for name in sorted(named - known)
    ]
