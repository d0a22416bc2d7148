# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters and codes of nodes, refused values, and the steps that reconfigure nodes."""

from types import SimpleNamespace

from interfaces import node_classes
from isotruss_msgs.action import FollowObjectPath, PlaceObject, PlanGrasp
from isotruss_msgs.msg import GraspState, ManipulationStatus
from isotruss_ros.core import Disc, load_robot, place_between, read_object, settle_grasp, Status
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.paths.path_servo import PathOutcome
from isotruss_ros.executables import NODES
from isotruss_ros.nodes.framework.common_parameters import make_body, read_described
from isotruss_ros.nodes.framework.parameters import ParameterError
from isotruss_ros.nodes.framework.runner import find_node
from isotruss_ros.nodes.grasp.grasp_report import GraspCode
from isotruss_ros.nodes.grasp.searcher import SearchOutcome
from isotruss_ros.nodes.simulator.node import Simulator
from isotruss_ros.nodes.viewer import view_requests
from isotruss_ros.nodes.viewer.view_requests import NodeRestart, OBJECT_NODES
from isotruss_ros.viewer.names import OBJECTS
from manual_actions import replace_clients
from manual_world import check_refused, world
import numpy as np
from probe import begin_context, DIAMETER, N, overrides
import pytest
import rclpy
from rclpy.parameter import Parameter
from rclpy.task import Future

CODES = {
    ManipulationStatus: Status,
    GraspState: GraspCode,
    FollowObjectPath.Result: PathOutcome,
    PlanGrasp.Result: SearchOutcome,
}
#: Field of a parameter's descriptor that has the range of a number.
RANGES = {
    Parameter.Type.DOUBLE.value: 'floating_point_range',
    Parameter.Type.INTEGER.value: 'integer_range',
}


@pytest.mark.parametrize('message', CODES, ids=lambda kind: kind.__name__)
def test_codes_are_those_of_the_message(message):
    codes = {(code.name, int(code)) for code in CODES[message]}
    names = [n for n in dir(message) if n.isupper() and not n.startswith(('SLOT_', 'HELD_'))]
    declared = {(name, getattr(message, name)) for name in names}
    assert codes <= declared, f'add to the message {message.__name__}: {codes - declared}'
    assert declared <= codes, f'add to {CODES[message]}: {declared - codes}'


@pytest.mark.parametrize('name', sorted(node_classes()))
def test_every_parameter_is_described_and_every_number_has_a_range(name):
    with world(node_classes()[name]) as w:
        node = w.nodes[1]
        names = node.get_parameters_by_prefix('')
        own = [name for name in names if not name.startswith(('use_', 'start_'))]
        for descriptor in node.describe_parameters(own):
            assert descriptor.description, f'{name}: {descriptor.name}: its Spec needs a text'
            range_field = RANGES.get(descriptor.type)
            assert range_field is None or getattr(descriptor, range_field), (
                f'{name}: {descriptor.name}: its Spec needs bounds'
            )


def list_parameters():
    """Yield node and name of each parameter that is a list of names."""
    for name, kind in node_classes().items():
        for spec in (*kind.base_specs, *kind.specs):
            if isinstance(spec.default, list) and isinstance(spec.default[0], str):
                yield name, spec.name


def start_with(tmp_path, name, parameter, value):
    """Return a node that reads a value, as text, of a parameter from a file."""
    file = tmp_path / 'parameters.yaml'
    file.write_text(f'/**: {{ros__parameters: {{{parameter}: {value}}}}}')
    begin_context(['--ros-args', '--params-file', str(file)])
    return node_classes()[name]()


@pytest.mark.parametrize(('name', 'parameter'), list_parameters())
def test_an_empty_list_of_a_parameter_file_or_of_a_request_is_no_name(tmp_path, name, parameter):
    node = start_with(tmp_path, name, parameter, '[]')
    assert node.get_parameter(parameter).value == ['']
    if parameter not in node.values.fixed:
        empty = Parameter(parameter, Parameter.Type.STRING_ARRAY, [])
        assert all(result.successful for result in node.set_parameters([empty]))
    node.destroy_node()
    rclpy.shutdown()


@pytest.mark.parametrize(
    ('name', 'parameter', 'words'),
    [
        ('manipulation', 'friction', 'a number'),
        ('simulator', 'object_pose', 'a list of numbers'),
        ('viewer', 'object', 'a text, in quotes'),
    ],
)
def test_an_empty_list_in_place_of_another_value_is_refused(tmp_path, name, parameter, words):
    with pytest.raises(ParameterError, match=f'{parameter}: an empty list: must be {words}$'):
        start_with(tmp_path, name, parameter, '[]')
    rclpy.shutdown()


REFUSED = [
    ('manipulation', {'robot': 'nobody'}, 'no such preset'),
    ('manipulation', {'grip_module': 'north/Nobody'}, 'no such module; .*its modules are'),
    ('manipulation', {'grip': ['nobody', 'south/P-Q']}, 'no such member'),
    ('manipulation', {'object': '{shape: star}'}, 'must be one of'),
    ('manipulation', {'failed_rollers': ['nobody']}, 'no such roller'),
    ('manipulation', {'rate': 'fast'}, 'rate'),
    ('manipulation', {'mode': 'joint'}, 'P, Q, R, X, Y, Z'),
    ('manipulation', {'mode': 'joints'}, 'must be one of'),
    ('manipulation', {'joint': 'S'}, 'no such joint'),
    ('manipulation', {'object_diameter': -1.0}, '^parameter object_diameter: -1.0: out of range'),
    ('grasp_analysis', {'object': 'nowhere/box.yaml'}, r'box\.yaml: cannot be read'),
    ('grasp_planner', {'workers': -1}, 'workers: -1: out of range; must be from 0 to 256'),
    ('simulator', {'robot': '/nowhere.yaml'}, 'no such file'),
    ('simulator', {'plant': 'soft'}, 'kinematic, elastic or mujoco'),
    ('simulator', {'object_diameter': 9.0}, 'does not fit'),
    ('simulator', {'object': '{shape: polygon}'}, 'vertices'),
    ('simulator', {'grip': ['south/P-Q']}, 'two or three different members'),
    ('simulator', {'grip': ['south/P-Q', 'east/R-Y']}, 'does not fit between'),
    ('simulator', {'stuck_roller': 'north/P'}, 'no such rollers'),
    ('simulator', {'object_pose': [1, 2]}, 'must be three numbers'),
]


@pytest.mark.parametrize(
    ('name', 'values', 'words'), REFUSED, ids=[f'{name}-{[*v][-1]}' for name, v, _ in REFUSED]
)
def test_bad_parameters_are_refused_at_start(name, values, words):
    check_refused(lambda: node_classes()[name](overrides(**values)), words)


#: Parameters of the object that sliders of the viewer set.
SETTINGS = ('object_diameter', 'friction')
DISC = f'{{shape: disc, diameter: {DIAMETER}}}'


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
