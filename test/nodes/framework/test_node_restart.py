# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The steps that reconfigure nodes, and their reports."""

from types import SimpleNamespace

from isotruss_msgs.action import PlaceObject
from isotruss_ros.core import Disc, load_robot, place_between, read_object, settle_grasp
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.nodes.simulator.node import Simulator
from isotruss_ros.nodes.viewer import view_requests
from isotruss_ros.nodes.viewer.view_requests import NodeRestart
from isotruss_ros.viewer.names import OBJECTS
from manual_actions import replace_clients
from manual_world import world
import numpy as np
from probe import N, overrides
import pytest
from rclpy.task import Future


class Clients:
    """Calls the services of the simulator at once."""

    def __init__(self, w):
        self._world = w
        self.before = lambda: None

    def create_client(self, kind, name):
        def call(request):
            self.before()
            response = Future()
            response.set_result(self._world.call(name, request))
            return response

        ready = name.partition('/')[0] == 'simulator'
        return SimpleNamespace(call_async=call, service_is_ready=lambda: ready)


@pytest.fixture
def w():
    with world(lambda: Simulator(overrides(plant='elastic', friction=0.8))) as w:
        yield w


def test_a_reset_returns_the_robot_to_home_with_the_same_plant(w):
    reports = []

    w.until(lambda: w.probe.last('joints') is not None)
    home = w.travel()
    command = [0.05] * N
    w.until(lambda: np.abs(w.travel() - home).max() > 0.01, lambda: w.probe.send_command(command))
    NodeRestart(Clients(w), reports.append).restart_simulator(0.0)
    assert reports == ['reset: sent', 'reset: active']
    assert w.nodes[1].get_parameter('plant').value == 'elastic'
    w.until(lambda: np.array_equal(w.travel(), home))


def test_a_later_restart_ends_an_earlier_one(w):
    reports, calls = [], []
    clients = Clients(w)
    restart = NodeRestart(clients, reports.append)

    def restart_again():
        calls.append(len(calls))
        if len(calls) == 3:
            restart.restart_simulator(0.0, 'kinematic')

    clients.before = restart_again
    restart.restart_simulator(0.0, 'elastic')
    assert reports == ['plant elastic: sent', 'plant kinematic: sent', 'plant kinematic: active']
    assert w.nodes[1].get_parameter('plant').value == 'kinematic'


def test_the_stage_of_an_object_goal_is_reported(monkeypatch):
    reports, feedback = [], PlaceObject.Feedback(stage=PlaceObject.Feedback.OPENING, progress=0.5)

    def send(_goal, note):
        note(SimpleNamespace(feedback=feedback))
        return Future()

    client = SimpleNamespace(server_is_ready=lambda: True, send_goal_async=send)
    replace_clients(monkeypatch, view_requests, lambda *_: client)
    view_requests.ObjectGoals(None, reports.append).send('place')
    assert reports == ['place: sent', 'place: opening 50 %']


@pytest.mark.parametrize('kind', OBJECTS)
def test_every_object_of_the_menu_is_held_where_it_begins(kind):
    robot, friction = load_robot('nine_member'), 0.8
    shape = read_object(OBJECTS[kind]).shape if OBJECTS[kind] else Disc(0.3)
    members = members_at(robot, 'north/Z')
    body = place_between(robot.home, members, shape, indentation=0.01).body
    assert settle_grasp(robot.home, body, friction).held
