# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The robots that come with the package, and objects from YAML."""

from isotruss_ros import core
from isotruss_ros.core import ConvexObject, Disc, Ellipse, Polygon, read_object
from isotruss_ros.core.errors import GraspError, ObjectFileError
from isotruss_ros.core.model.presets import preset_names
import numpy as np
import pytest

BOX = """
shape: polygon
vertices: [[0, 0], [0.3, 0], [0.3, 0.2], [0, 0.2]]
corner_radius: 0.01
mass: 1.5
center_of_mass: [0.15, 0.1]
friction: 0.4
"""
VERTICES = ((0.0, 0.0), (0.3, 0.0), (0.3, 0.2), (0.0, 0.2))


def test_reads_a_box_from_a_file(tmp_path):
    path = tmp_path / 'box.yaml'
    path.write_text(BOX, encoding='utf-8')
    box = ConvexObject(Polygon(VERTICES, 0.01), mass=1.5, center_of_mass=(0.15, 0.1), friction=0.4)
    assert read_object(path) == read_object(str(path)) == box


def test_reads_objects_from_text():
    assert read_object('{shape: disc, diameter: 0.2}') == ConvexObject(Disc(0.2))
    ellipse = read_object('{shape: ellipse, semi_axes: [0.2, 0.1], friction: 0}')
    assert ellipse == ConvexObject(Ellipse((0.2, 0.1)), friction=0.0)


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('{}', "key 'shape' is missing; it is one of disc, polygon, ellipse"),
        ('{shape: box}', "shape: 'box': must be one of"),
        ('{shape: disc}', "'diameter' is missing; a disc needs it"),
        ('{shape: disc, diametre: 0.1}', 'did you mean diameter'),
        ('{shape: disc, diameter: 0.1, vertices: []}', "unknown key 'vertices'"),
        ('{shape: polygon, vertices: [[0, 0], [1, 0]]}', 'at least 3'),
        ('{shape: polygon, vertices: [[0, 0], [1, 0], [1, [0]]]}', 'vertex 3'),
        ('{shape: disc, diameter: 30}', 'diameter 30 m: .* if it is in cm, it is 0.3 m'),
        ('{shape: disc, diameter: 0.3, mass: 800}', 'mass 800 kg: .* if it is in g, it is 0.8 kg'),
        (
            '{shape: ellipse, semi_axes: [200, 90]}',
            'semi_axes 200.0 m: must be from .* if it is in mm, it is 0.2 m',
        ),
        ('{shape: disc', 'not YAML'),
        ('{shape: &a disc}', 'anchors and aliases are not used in object files'),
        *((given, 'must be the path of a file, or a text') for given in (None, 5, ['a'], '', ' ')),
    ],
)
def test_invalid_object_descriptions_are_refused(text, words):
    with pytest.raises(ObjectFileError, match=words):
        read_object(text)


def test_refuses_files_with_their_name(tmp_path):
    path = tmp_path / 'none.yaml'
    with pytest.raises(GraspError, match=r'none\.yaml: cannot be read'):
        read_object(path)
    path.write_text('- 1', encoding='utf-8')
    with pytest.raises(ObjectFileError, match=r'none\.yaml: .* must be keys and values'):
        read_object(path)
    path.write_bytes(b'\xff')
    with pytest.raises(ObjectFileError, match='not UTF-8'):
        read_object(path)


#: Number of rollers, and a module whose grip moves an object in this many directions.
PRESETS = {
    'bow_tie': (4, 'upper/D', 3),
    'nine_member': (6, 'north/Z', 3),
    'open_chain': (6, 'right/G', 2),
    'ring_of_four': (8, 'north/T', 3),
    'triangle': (2, 'main/T', 1),
}


def test_all_presets_are_tested():
    assert preset_names() == sorted(PRESETS)


@pytest.mark.parametrize('name', PRESETS)
def test_a_preset_is_rigid_and_moves_an_object_by_each_roller(name):
    robot = core.load_robot(name)
    rollers, module, directions = PRESETS[name]
    assert np.linalg.matrix_rank(robot.home.node_jacobian) == len(robot.roller_names) == rollers
    top = robot.topology.joint_names[-1]
    assert np.isfinite(core.deform(robot.home, {top: (1.0, -1.0)}).displacement(top)).all()
    body = core.ConvexObject.disc(core.tangent_center(robot.home, module, 0.3), 0.3)
    grip = core.Grip.at_module(robot, module, body)
    twists = core.reachable_twists(robot.home, grip)
    assert len(twists) == directions
    assert core.solve_twist(robot.home, grip, 0.01 * twists[0]).status is core.Status.OK
