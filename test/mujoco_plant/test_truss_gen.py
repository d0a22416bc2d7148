# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Exchange with mujoco-truss-gen: there and back, and what is refused."""

import json
import os
import subprocess

from isotruss_ros.core import load_robot
from isotruss_ros.mujoco_plant.options import PlantError
from isotruss_ros.mujoco_plant.truss_gen import from_truss_gen, to_truss_gen
import numpy as np
import pytest
from ruamel.yaml import YAML

#: A Python that has mujoco-truss-gen, which asks for another MuJoCo than ours.
PYTHON = os.environ.get('TRUSS_GEN_PYTHON', '')
SQUARE = {'a': [0, 0, 0], 'b': [1.5, 0, 0], 'c': [0.75, 1.3, 0]}


def read(content, tmp_path):
    """Return the robot of a robot file's content."""
    path = tmp_path / 'robot.yaml'
    yaml = YAML(typ='safe', pure=True)
    yaml.sort_base_mapping_type_on_output = False  # the order of tubes is that of the rollers
    with path.open('w', encoding='utf-8') as file:
        yaml.dump(content, file)
    return load_robot(str(path))


@pytest.mark.parametrize('name', ['nine_member', 'triangle'])
def test_a_robot_comes_back_as_it_was(name, tmp_path):
    robot = load_robot(name)
    nodes, triangles = to_truss_gen(robot)
    assert {len(place) for place in nodes.values()} == {3}
    file = robot.description
    back = read(from_truss_gen(nodes, triangles, name, name, file.supports), tmp_path)
    assert back.module_names == robot.module_names
    assert back.roller_names == robot.roller_names
    np.testing.assert_allclose(back.home.nodes, robot.home.nodes, atol=1e-9)


@pytest.mark.parametrize('turn', [(0, 1, 2), (0, 2, 1), (2, 0, 1)])
def test_a_triangle_in_any_plane_is_a_robot_of_the_same_lengths(turn, tmp_path):
    nodes = {name: [place[axis] for axis in turn] for name, place in SQUARE.items()}
    robot = read(from_truss_gen(nodes, {'t': ['a', 'b', 'c', 'b']}), tmp_path)
    joints = robot.home.points[: len(nodes)]
    expected = np.linalg.norm(np.subtract(nodes['a'], nodes['b']))
    assert abs(joints[0] - joints[1]) == pytest.approx(expected)
    assert 't/b' not in robot.roller_names
    assert len(robot.roller_names) == 2


@pytest.mark.parametrize(
    ('nodes', 'triangle', 'words'),
    [
        (SQUARE | {'d': [0.7, 0.4, 1.0]}, ['a', 'b', 'c', 'a'], 'out of one plane'),
        (SQUARE, ['a', 'b', 'c', 'd'], 'passive one'),
        (SQUARE, ['a', 'b', 'b', 'a'], 'three nodes'),
        (SQUARE, ['a', 'b', 'd', 'a'], 'there is no node d'),
        ({'a': [0.0, 0.0, 0.0]}, ['a', 'b', 'c', 'a'], 'three nodes or more'),
    ],
)
def test_what_is_no_planar_robot_of_triangles_is_refused(nodes, triangle, words):
    with pytest.raises(PlantError, match=words):
        from_truss_gen(nodes, {'t': triangle})


@pytest.mark.skipif(not PYTHON, reason='TRUSS_GEN_PYTHON names no Python with mujoco-truss-gen')
def test_mujoco_truss_gen_builds_what_is_written():
    nodes, triangles = to_truss_gen(load_robot('nine_member'))
    code = (
        'import json, sys\n'
        'from mujoco_truss_gen.mujoco_model.builders import get_mujoco_spec\n'
        'nodes, triangles = json.load(sys.stdin)\n'
        'model = get_mujoco_spec(nodes, triangles).compile()\n'
        'print(json.dumps([model.nu, [model.body(i).name for i in range(model.nbody)]]))\n'
    )
    done = subprocess.run(
        [PYTHON, '-c', code],
        input=json.dumps([nodes, triangles]),
        capture_output=True,
        text=True,
        check=True,
    )
    actuators, bodies = json.loads(done.stdout.splitlines()[-1])
    assert actuators > 0
    for node in nodes:
        assert any(node in body for body in bodies), (node, bodies)
