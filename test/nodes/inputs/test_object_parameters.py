# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The parameters of the object have one meaning, and reach every model that uses them."""

from isotruss_msgs.action import PlaceObject
from isotruss_msgs.msg import GraspState
from isotruss_ros.core import place_between
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.model.shapes import Disc
from isotruss_ros.core.planning.release import Release
from isotruss_ros.core.planning.violations import Violation
from isotruss_ros.executables import NODES
from isotruss_ros.nodes.conversions.messages import make_header
from isotruss_ros.nodes.framework.runner import find_node
from isotruss_ros.nodes.pick_and_place import grasp_sequences
from isotruss_ros.nodes.pick_and_place.node import PickAndPlace
from isotruss_ros.nodes.simulator.node import Simulator
from isotruss_ros.nodes.state_estimator import StateEstimatorNode
from isotruss_ros.nodes.viewer.view_requests import OBJECT_NODES
from manual_world import world
import numpy as np
from probe import CENTER, DIAMETER, maker, MODULE, N, ROBOT
import pytest

#: Parameters of the object that sliders of the viewer set.
SETTINGS = ('object_diameter', 'friction')
DISC = f'{{shape: disc, diameter: {DIAMETER}}}'
#: Friction of the object in its description, and in the models of a node with friction 0.8.
FRICTIONS = [('', 0.8), (DISC, 0.8), (DISC.replace('}', ', friction: 0.6}'), 0.6)]


@pytest.mark.parametrize(('described', 'expected'), FRICTIONS)
def test_a_release_is_planned_with_the_friction_of_object_or_parameter(
    monkeypatch, described, expected
):
    planned = []

    def plan(_config, body, *_):
        planned.append(body.friction)
        return Release(np.empty((0, N)), 0, Violation('squeeze', 1.0, 0.0))

    monkeypatch.setattr(grasp_sequences, 'plan_release', plan)
    with world(maker(PickAndPlace, friction=0.8, object=described)()) as w:
        states = w.probe.create_publisher(GraspState, 'grasp/state', 1)

        def send():
            w.probe.send_joints()
            w.probe.send_pose()
            header = make_header(w.probe.past(0.0), 'truss')
            states.publish(GraspState(header=header, held=True, force_closure=True))

        w.spin(0.1, send)
        goal = w.send_goal(PlaceObject.Goal())
        w.until(lambda: goal.ended, send)
    assert planned == [expected]


@pytest.mark.parametrize(('described', 'expected'), FRICTIONS)
def test_the_estimator_uses_the_friction_of_object_or_parameter(described, expected):
    with world(maker(StateEstimatorNode, friction=0.8, object=described)()) as w:
        assert w.nodes[1]._estimator.grip.friction == expected


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
    names = {name: {spec.name for spec in each} for name, each in specs.items()}
    having = {name for name, each in names.items() if each >= {'object', *SETTINGS}}
    assert having - {'simulator', 'viewer'} == set(OBJECT_NODES)
