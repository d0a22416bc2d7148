# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The parameters of the object have one meaning, and reach every model that uses them."""

from types import SimpleNamespace

from isotruss_ros.core import place_between
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.model.shapes import Disc
from isotruss_ros.executables import NODES
from isotruss_ros.nodes.framework.common_parameters import make_body, read_described
from isotruss_ros.nodes.framework.runner import find_node
from isotruss_ros.nodes.simulator.node import Simulator
from isotruss_ros.nodes.viewer.view_requests import OBJECT_NODES
from manual_world import world
import numpy as np
from probe import CENTER, DIAMETER, maker, MODULE, ROBOT
import pytest

#: Parameters of the object that sliders of the viewer set.
SETTINGS = ('object_diameter', 'friction')
DISC = f'{{shape: disc, diameter: {DIAMETER}}}'


@pytest.mark.parametrize('described', ['', DISC])
def test_the_indentation_of_a_held_object_is_its_penetration_of_each_member(described):
    depth = 0.01
    values = {'object': described, 'object_diameter': DIAMETER, 'grip_module': MODULE}
    with world(maker(Simulator, indentation=depth, **values)()) as w:
        w.until(lambda: w.place() is not None)
        members = members_at(ROBOT, MODULE)
        body = place_between(ROBOT.home, members, Disc(DIAMETER), indentation=depth).body
        assert w.place()[:2] == pytest.approx(np.array(body.pose[:2]), abs=1e-9)
        # In a corner of 60 degrees the object is shifted by twice the depth.
        assert np.hypot(*(w.place()[:2] - CENTER)) == pytest.approx(2.0 * depth)


def test_the_viewer_sets_the_object_of_all_nodes_that_have_its_parameters():
    specs = {name: find_node(name).specs for name in NODES}
    names = {node: {spec.name for spec in of_node} for node, of_node in specs.items()}
    expected = {node for node in names if names[node] >= {'object', *SETTINGS}}
    assert set(OBJECT_NODES) == expected - {'simulator', 'viewer'}


@pytest.mark.parametrize(
    ('described', 'expected'),
    [('', 0.8), (DISC, 0.8), (DISC.replace('}', ', friction: 0.6}'), 0.6)],
)
def test_friction_is_that_of_the_object_or_of_the_parameter(described, expected):
    values = SimpleNamespace(object=described, object_diameter=DIAMETER, friction=0.8)
    body = make_body(values, read_described(values))
    assert (body.friction, body.shape) == (expected, Disc(DIAMETER))
