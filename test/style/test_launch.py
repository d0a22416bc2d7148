# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Launch files start existing executables with declared parameters; `launch` may be a stand-in."""

import importlib
import importlib.util
from pathlib import Path
import runpy
import sys
from types import ModuleType, SimpleNamespace

from isotruss_ros.nodes.framework.parameters import AUTOSTART, ParameterError, ROBOT
from isotruss_ros.nodes.framework.runner import find_node
from isotruss_ros.nodes.grasp_analysis import GraspAnalysisNode
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.simulator.node import Simulator
from manual_world import world
from nightly import some_now
from probe import overrides
import pytest
from ruamel.yaml import YAML

#: Whether they are started unless an argument says otherwise.
OPTIONAL = {
    'path_follower': True,
    'grasp_planner': True,
    'pick_and_place': True,
    'state_estimator': False,
    'viewer': False,
}
FOLDER = Path(__file__).parents[2] / 'launch'
MODULES = """
launch launch.actions launch.conditions launch.substitutions
launch_ros launch_ros.actions launch_ros.parameter_descriptions
"""
KINDS = """
LaunchDescription LaunchContext LaunchConfiguration DeclareLaunchArgument OpaqueFunction LogInfo
IfCondition Shutdown Node ParameterValue
"""


class StandIn(ModuleType):
    """A module whose classes keep the arguments of their constructors."""

    def __getattr__(self, kind):
        if kind not in KINDS.split():
            raise AttributeError(kind)
        return lambda *args, **fields: SimpleNamespace(kind=kind, args=args, **fields)


@pytest.fixture
def stand_in(monkeypatch):
    """Put a stand-in for launch in its place."""
    for name in MODULES.split():
        monkeypatch.setitem(sys.modules, name, StandIn(name))
    monkeypatch.delitem(sys.modules, 'isotruss_ros.nodes.framework.launching', raising=False)
    yield
    sys.modules.pop('isotruss_ros.nodes.framework.launching', None)


def describe(path):
    """Return the entities that a launch file describes, and its defaults."""
    names = runpy.run_path(str(path))
    (entities,) = names['generate_launch_description']().args
    return entities, names.get('DEFAULTS', {})


@pytest.fixture(params=sorted(FOLDER.glob('*tion.launch.py')), ids=lambda path: path.name)
def path(request):
    """Return the path of each launch file of our nodes."""
    return request.param


@pytest.fixture
def entities(path, stand_in):
    return describe(path)[0]


@pytest.fixture
def nodes(entities):
    return [entity for entity in entities if entity.kind == 'Node']


def specs_of(executable):
    """Return the parameters that a node declares, by name."""
    return {spec.name: spec for spec in (*find_node(executable).specs, ROBOT, AUTOSTART)}


def test_arguments_are_parameters_with_the_defaults_of_the_nodes(path, entities, nodes):
    defaults = describe(path)[1]
    arguments = {e.args[0]: e for e in entities if e.kind == 'DeclareLaunchArgument'}
    used = {'namespace', 'parameters', *OPTIONAL}
    for node in nodes:
        assert node.namespace.args == ('namespace',)
        assert node.package == 'isotruss_ros'
        specs = specs_of(node.executable)
        file, parameters = node.parameters
        assert file.args == ('parameters',)
        for name, value in parameters.items():
            used.add(name)
            assert value.args[0].args == (name,)
            if name == 'use_sim_time':
                assert value.value_type is bool
                continue
            default = specs[name].default
            expected = list[type(default[0])] if isinstance(default, list) else type(default)
            assert value.value_type == expected, name
            default = arguments[name].default_value
            if default is not None:
                readers = {bool: 'true'.__eq__}
                readers |= dict.fromkeys((list[str], list[float]), YAML(typ='safe').load)
                read = readers.get(value.value_type, value.value_type)
                assert read(default) == defaults.get(name, specs[name].default), name
    assert used == set(arguments)
    missing = {name for name, argument in arguments.items() if argument.default_value is None}
    real = {'robot', 'object_diameter', 'grip_module'}
    assert missing == (real if path.name.startswith('manipulation') else set())


def test_all_nodes_shut_down_when_one_ends(nodes):
    assert [node.on_exit.kind for node in nodes] == ['Shutdown'] * len(nodes)


def test_unknown_arguments_are_named_and_missing_files_end_the_launch_before_any_node(entities):
    kinds = [entity.kind for entity in entities]
    assert kinds.index('OpaqueFunction') < kinds.index('Node')
    check = entities[kinds.index('OpaqueFunction')].function
    context = SimpleNamespace(
        argv=['robot:=triangle', 'namespace:=left', 'object_lies_free:=true'],
        launch_configurations={'parameters': __file__},
    )
    (warning,) = check(context)
    assert 'object_lies_free: unknown' in warning.msg
    context.launch_configurations['parameters'] = '/nowhere.yaml'
    with pytest.raises(ParameterError, match=r'launch argument parameters: /nowhere\.yaml'):
        check(context)


@pytest.mark.parametrize('robot', some_now(['nine_member', 'triangle']))
def test_simulation_starts_with_a_held_object(robot, stand_in):
    values = {'robot': robot} | describe(FOLDER / 'simulation.launch.py')[1]

    def maker(kind):
        names = {spec.name for spec in importlib.import_module(kind.__module__).SPECS}
        own = {name: value for name, value in values.items() if name in names}
        return lambda: kind(overrides(**own))

    with world(*map(maker, (Simulator, GraspAnalysisNode, Manipulation))) as w:
        w.until(lambda: w.probe.last('closure') is not None and w.probe.last('closure').data)
        w.until(lambda: w.command().any(), lambda: w.probe.send_twist((0.005, 0.0, 0.0)))
        w.spin(0.5, lambda: w.probe.send_twist((0.005, 0.0, 0.0)))
        assert w.probe.last('closure').data


@pytest.mark.skipif(
    importlib.util.find_spec('launch') is None or importlib.util.find_spec('launch_ros') is None,
    reason='launch and launch_ros come with a ROS 2 installation, there are no wheels of them',
)
def test_launch_accepts_the_files(path):
    description = runpy.run_path(str(path))['generate_launch_description']()
    assert len(description.entities) > 8


def test_parameter_file_has_the_other_parameters_with_their_defaults(path, entities, nodes):
    arguments = [e for e in entities if e.kind == 'DeclareLaunchArgument']
    (argument,) = (e for e in arguments if 'parameters' in e.args)
    written = YAML(typ='safe').load(Path(argument.default_value))
    for node in nodes:
        specs = specs_of(node.executable)
        if node.executable == 'viewer':
            del specs['autostart']
        file = written.get(f'/**/{node.executable}', {}).get('ros__parameters', {})
        for name, value in file.items():
            assert value == specs[name].default, name
            assert type(value) is type(specs[name].default), name
        if path.name.startswith('simulation'):
            given = file.keys() | node.parameters[1].keys()
            missing = specs.keys() - given
            assert not missing, (
                f'{node.executable}: {sorted(missing)}: add to config/nodes/parameters.yaml or '
                'to ARGUMENTS in nodes/framework/launching.py'
            )
            assert given - specs.keys() == {'use_sim_time'}
