# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The steps that configure the simulator anew, and what is said where one fails."""

from types import SimpleNamespace

from isotruss_ros.nodes.simulator.node import Simulator
from isotruss_ros.nodes.viewer.view_requests import SimulatorRestart
from manual_world import world
import numpy as np
from probe import N, overrides
import pytest
from rclpy.task import Future


class Clients:
    """Calls the services of a node at once."""

    def __init__(self, w, ready=True):
        self._world, self._ready = w, ready
        self.before = lambda: None

    def create_client(self, kind, name):
        """Return a client."""

        def call(request):
            self.before()
            done = Future()
            done.set_result(self._world.call(name, request))
            return done

        return SimpleNamespace(call_async=call, service_is_ready=lambda: self._ready)


@pytest.fixture
def w():
    """Return a simulator, elastic."""
    with world(lambda: Simulator(overrides(plant='elastic', friction=0.8))) as made:
        yield made


def test_the_simulator_is_active_with_the_other_plant(w):
    said = []
    restart = SimulatorRestart(Clients(w), said.append)
    for plant in ('kinematic', 'elastic'):
        restart.restart(plant)
        assert said[-1] == f'plant {plant}: active'
        assert w.nodes[1].get_parameter('plant').value == plant
        assert w.nodes[1].active


def test_a_reset_puts_the_robot_home_with_the_same_plant(w):
    said = []

    w.until(lambda: w.probe.last('joints') is not None)
    home = w.travel()
    command = [0.05] * N
    w.until(lambda: np.abs(w.travel() - home).max() > 0.01, lambda: w.probe.send_command(command))
    SimulatorRestart(Clients(w), said.append).restart()
    assert said == ['reset: active']
    assert w.nodes[1].get_parameter('plant').value == 'elastic'
    w.until(lambda: np.array_equal(w.travel(), home))


def test_a_plant_that_there_is_not_is_told_and_another_one_works(w):
    said = []
    restart = SimulatorRestart(Clients(w), said.append)
    restart.restart('soft')
    assert 'plant soft cannot be' in said[-1]
    assert not w.nodes[1].active
    restart.restart('kinematic')
    assert said[-1] == 'plant kinematic: active'


def test_a_later_restart_ends_an_earlier_one(w):
    said, calls = [], []
    clients = Clients(w)
    restart = SimulatorRestart(clients, said.append)

    def restart_again():
        calls.append(len(calls))
        if len(calls) == 3:
            restart.restart('kinematic')

    clients.before = restart_again
    restart.restart('elastic')
    assert said == ['plant kinematic: active']
    assert w.nodes[1].get_parameter('plant').value == 'kinematic'
    assert len(calls) == 3 + 5


def test_without_a_simulator_it_says_so(w):
    said = []
    SimulatorRestart(Clients(w, ready=False), said.append).restart('elastic')
    assert said == ['plant elastic: there is no simulator']
