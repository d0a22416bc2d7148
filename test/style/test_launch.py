"""
The launch files start executables that there are, with parameters that these declare.

Where `launch` is not installed (there are no wheels of it), a stand-in takes down what they say.
"""

import importlib
import importlib.util
from pathlib import Path
import runpy
import sys
from types import ModuleType, SimpleNamespace

from isotruss_ros.nodes.framework.parameters import AUTOSTART
import pytest

FOLDER = Path(__file__).parents[2] / 'launch'
MODULES = (
    'launch',
    'launch.actions',
    'launch.substitutions',
    'launch_ros',
    'launch_ros.actions',
    'launch_ros.parameter_descriptions',
)


def record(kind):
    """Return a class that keeps what it is made with."""
    return lambda *args, **fields: SimpleNamespace(kind=kind, args=args, **fields)


@pytest.fixture
def stand_in(monkeypatch):
    """Put a stand-in for launch in its place, which keeps everything as it is given."""
    for name in MODULES:
        module = ModuleType(name)
        for kind in (
            'LaunchDescription',
            'DeclareLaunchArgument',
            'LaunchConfiguration',
            'Node',
            'ParameterValue',
        ):
            setattr(module, kind, record(kind))
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, 'isotruss_ros.nodes.framework.launching', raising=False)
    yield
    sys.modules.pop('isotruss_ros.nodes.framework.launching', None)


def specs_of(executable):
    """Return the parameters that a node declares, by name."""
    module = importlib.import_module(f'isotruss_ros.nodes.{executable}')
    return {spec.name: spec for spec in (*module.SPECS, AUTOSTART)}


@pytest.mark.parametrize('path', sorted(FOLDER.glob('*.launch.py')), ids=lambda path: path.name)
def test_arguments_are_parameters_with_the_defaults_of_the_nodes(path, stand_in):
    description = runpy.run_path(str(path))['generate_launch_description']()
    (entities,) = description.args
    arguments = {e.args[0]: e for e in entities if e.kind == 'DeclareLaunchArgument'}
    nodes = [e for e in entities if e.kind == 'Node']
    assert len(nodes) >= 4
    used = set()
    for node in nodes:
        assert node.package == 'isotruss_ros'
        specs = specs_of(node.executable)
        (parameters,) = node.parameters
        for name, value in parameters.items():
            used.add(name)
            assert value.args[0].args == (name,)
            if name == 'use_sim_time':
                assert value.value_type is bool
                continue
            assert value.value_type is type(specs[name].default), name
            default = arguments[name].default_value
            if default is not None:
                read = {bool: 'true'.__eq__}.get(value.value_type, value.value_type)
                assert read(default) == specs[name].default, name
    assert used == set(arguments)
    missing = {name for name, argument in arguments.items() if argument.default_value is None}
    real = {'robot', 'object_diameter', 'grip_module'}
    assert missing == (real if path.name.startswith('manipulation') else set())


@pytest.mark.skipif(
    importlib.util.find_spec('launch') is None or importlib.util.find_spec('launch_ros') is None,
    reason='launch and launch_ros come with a ROS 2 installation, there are no wheels of them',
)
@pytest.mark.parametrize('path', sorted(FOLDER.glob('*.launch.py')), ids=lambda path: path.name)
def test_launch_takes_the_files(path):
    description = runpy.run_path(str(path))['generate_launch_description']()
    assert len(description.entities) > 8
