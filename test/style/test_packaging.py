# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Manifests, setup.py, requirements, CITATION.cff and imports of the sources agree."""

import importlib
from pathlib import Path
import re
import signal
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

from isotruss_ros import executables
from isotruss_ros.extras import UBUNTU_PACKAGES
from isotruss_ros.nodes.framework.runner import find_node
import pytest
import setuptools

ROOT = Path(__file__).resolve().parents[2]
IMPORT = re.compile(
    r'^ *(?:from (\w+)[\w.]* import|import (\w+)[\w.]*(?: as \w+)?(?:  #.*)?$)', re.MULTILINE
)
# Import name to rosdep key, where they differ (ROS packages are their own key).
ROSDEP_KEYS = {
    **{'PIL': 'python3-pil', 'pytest_timeout': 'python3-pytest-timeout', 'tf2_ros': 'tf2_ros_py'},
    **{'ruamel': 'python3-ruamel.yaml'},
}
NAMED_ALIKE = 'hypothesis jsonschema matplotlib numpy psutil pytest rich scipy setuptools yaml'
ROSDEP_KEYS |= {name: f'python3-{name}' for name in NAMED_ALIKE.split()}
# No rosdep keys: what needs them is taken, and tested, where they are installed.
ONLY_FROM_PYPI = {'daqp', 'distributed', 'gymnasium', 'mcap', 'msgspec', 'mujoco', 'playwright'}
ONLY_FROM_PYPI |= {'openseespylinux', 'pyarrow', 'qpsolvers', 'quadprog', 'rosbags', 'vermin'}
ONLY_FROM_PYPI |= {'lz4', 'viser', 'websockets', 'zstandard'}


@pytest.fixture(scope='module')
def manifest():
    return ElementTree.parse(ROOT / 'package.xml').getroot()


def read_setup(command):
    """Return the arguments of setuptools.setup for a command; nothing is built."""
    arguments = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        patch.setattr(sys, 'argv', ['setup.py', command])
        patch.setattr(setuptools, 'setup', arguments.update)
        exec(compile((ROOT / 'setup.py').read_text(), 'setup.py', 'exec'), {})
    return arguments


@pytest.fixture(scope='module')
def setup_arguments():
    return read_setup('bdist_wheel')


@pytest.fixture(scope='module')
def pins():
    """Return the lines of the files that pin versions, without comments."""
    lines = [
        line for file in ROOT.glob('requirements*.txt') for line in file.read_text().splitlines()
    ]
    return [line for line in (line.split('#')[0].strip() for line in lines) if line]


def dependencies(manifest, *kinds):
    return {element.text for kind in kinds for element in manifest.findall(kind)}


def imports(folder):
    """Return the top-level names that the modules under a folder import, by first user."""
    names = {}
    for path in sorted(folder.rglob('*.py')):
        for first, second in IMPORT.findall(path.read_text()):
            names.setdefault(first or second, path)
    own = {'isotruss_ros', 'studies'}
    foreign = names.keys() - sys.stdlib_module_names - own
    return {name: names[name] for name in foreign}


def test_version_and_date_of_the_release_agree(manifest, setup_arguments):
    messages = ElementTree.parse(ROOT / 'msg_defs' / 'package.xml').getroot()
    version = manifest.findtext('version')
    assert setup_arguments['version'] == messages.findtext('version') == version
    citation = (ROOT / 'CITATION.cff').read_text()
    (date,) = re.findall('^date-released: (.+)$', citation, re.MULTILINE)
    assert f'\nversion: {version}\n' in citation
    for folder in (ROOT, ROOT / 'msg_defs'):
        heading = re.search(r'^\d.*$', (folder / 'CHANGELOG.rst').read_text(), re.MULTILINE)
        assert heading.group() == f'{version} ({date})', folder


def test_descriptions_and_licenses_agree(manifest, setup_arguments):
    for name in ('name', 'license', 'description', 'maintainer'):
        assert manifest.findtext(name) == setup_arguments[name]
    address = {'email': setup_arguments['maintainer_email']}
    for folder in (ROOT, ROOT / 'msg_defs'):
        declared = ElementTree.parse(folder / 'package.xml').getroot()
        assert declared.find('maintainer').attrib == address
        assert (folder / 'LICENSE').read_bytes() == (ROOT / 'LICENSE').read_bytes()


@pytest.mark.parametrize('command', ['install', 'develop'])
def test_colcon_installs_every_executable(command):
    scripts = read_setup(command)['entry_points']['console_scripts']
    names = [line.partition(' = ')[0] for line in scripts]
    assert names == ['isotruss', *executables.NODES, *executables.PROGRAMS]
    for line in scripts:
        module, function = re.fullmatch(r'\w+ = ([\w.]+):(\w+)', line).groups()
        assert callable(getattr(importlib.import_module(module), function, None)), line
    for name in executables.NODES:
        assert callable(find_node(name))


@pytest.mark.parametrize('arguments', [[], ['demos']])
def test_command_line_without_a_known_subcommand_is_refused(arguments, monkeypatch, capsys):
    monkeypatch.setattr(sys, 'argv', ['isotruss', *arguments])
    with pytest.raises(SystemExit, match='2'):
        executables.isotruss()
    assert 'COMMAND' in capsys.readouterr().err


def test_every_subcommand_prints_its_help(monkeypatch, capsys):
    before = {which: signal.getsignal(which) for which in (signal.SIGINT, signal.SIGTERM)}
    for name in (*executables.REQUESTS, *executables.PROGRAMS, *executables.NODES):
        monkeypatch.setattr(sys, 'argv', ['isotruss', name, '--help'])
        with pytest.raises(SystemExit) as ended:
            executables.isotruss()
        if str(ended.value).startswith('this needs '):
            continue  # an extra that is not installed
        assert ended.value.code == 0
        assert f'usage: isotruss {name} ' in capsys.readouterr().out, name
    for which, handler in before.items():
        signal.signal(which, handler)


@pytest.mark.parametrize('folder', ['isotruss_ros', 'test'])
def test_imported_packages_are_declared(folder, manifest):
    kinds = ['depend', 'exec_depend'] + ['test_depend'] * (folder == 'test')
    declared = dependencies(manifest, *kinds)
    declared |= {ROSDEP_KEYS[name] for name in UBUNTU_PACKAGES}
    own = (ROOT / 'test' / 'helpers', ROOT / 'docs' / '_ext', ROOT / 'tools')
    for name, path in imports(ROOT / folder).items():
        if name in ONLY_FROM_PYPI or any((each / f'{name}.py').exists() for each in own):
            continue
        key = ROSDEP_KEYS.get(name, name)
        assert key in declared, f'{path} imports {name}: package.xml has to declare {key}'


NODES_ALONE = """
import sys

from isotruss_ros import executables, extras

sys.modules |= dict.fromkeys(extras.UBUNTU_PACKAGES)  # their import raises ModuleNotFoundError
from isotruss_ros.nodes.framework.runner import find_node

for name in executables.NODES:
    find_node(name)
"""


def test_nodes_load_without_the_optional_packages(manifest):
    assert dependencies(manifest, 'exec_depend').isdisjoint(UBUNTU_PACKAGES.values())
    subprocess.run([sys.executable, '-c', NODES_ALONE], check=True, timeout=120)


def test_each_dependency_of_the_nodes_has_its_reason():
    lines = (ROOT / 'package.xml').read_text().splitlines()
    assert not [line for line in lines if '<exec_depend>' in line and '<!-- ' not in line]


def test_requirements_pin_the_packages_of_setup(pins, setup_arguments):
    pinned = {pin.split('==')[0].lower() for pin in pins}
    wanted = list(setup_arguments['install_requires'])
    for extra in setup_arguments['extras_require'].values():
        wanted += extra
    assert {re.split('[<>=!]', name)[0].lower() for name in wanted} <= pinned


def test_robot_files_are_installed_where_ros_and_plain_python_look(setup_arguments):
    files = {path.relative_to(ROOT).as_posix() for path in (ROOT / 'config').glob('*.*')}
    data_files = dict(setup_arguments['data_files'])
    assert files == set(data_files['share/isotruss_ros/config'])
    assert 'isotruss_ros.config' in setup_arguments['packages']
    assert (ROOT / 'isotruss_ros' / 'config').samefile(ROOT / 'config')
