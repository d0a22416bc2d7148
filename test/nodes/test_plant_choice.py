# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Another plant: the steps that configure the simulator anew, and what is said where one fails."""

from types import SimpleNamespace

from isotruss_ros.nodes.components.plant_choice import PlantChoice
from isotruss_ros.nodes.simulator import Simulator
from manual_world import world
from probe import overrides
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
    choice = PlantChoice(Clients(w), said.append)
    for plant in ('kinematic', 'elastic'):
        choice.choose(plant)
        assert said[-1] == f'plant {plant}: active'
        assert w.nodes[1].get_parameter('plant').value == plant
        assert w.nodes[1].state == 'active'


def test_a_plant_that_there_is_not_is_told_and_another_one_works(w):
    said = []
    choice = PlantChoice(Clients(w), said.append)
    choice.choose('soft')
    assert 'plant soft cannot be' in said[-1]
    assert w.nodes[1].state != 'active'
    choice.choose('kinematic')
    assert said[-1] == 'plant kinematic: active'


def test_a_later_choice_ends_an_earlier_one(w):
    said, calls = [], []
    clients = Clients(w)
    choice = PlantChoice(clients, said.append)

    def choose_another():
        calls.append(len(calls))
        if len(calls) == 3:
            choice.choose('kinematic')

    clients.before = choose_another
    choice.choose('elastic')
    assert said == ['plant kinematic: active']
    assert w.nodes[1].get_parameter('plant').value == 'kinematic'
    assert len(calls) == 3 + 5


def test_without_a_simulator_it_says_so(w):
    said = []
    PlantChoice(Clients(w, ready=False), said.append).choose('elastic')
    assert said == ['plant elastic: there is no simulator']
