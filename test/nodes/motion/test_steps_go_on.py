# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Goals of all nodes end as asked, in spite of noise, early joint states and late analyses.

The nodes are starved of processor time as well: each callback takes a random time.
"""

import copy

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.action import FollowObjectPath, MoveObject, PickObject, PlaceObject
from isotruss_msgs.msg import GraspState
from isotruss_ros.core import Pose, Status
from isotruss_ros.nodes.conversions.messages import make_header, to_pose_message
from isotruss_ros.nodes.grasp_analysis import GraspAnalysisNode
from isotruss_ros.nodes.grasp_planner import GraspPlanner
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.path_follower import PathFollower
from isotruss_ros.nodes.pick_and_place.node import PickAndPlace
from isotruss_ros.nodes.simulator.node import Simulator
from manual_actions import connect
from manual_world import world
from nav_msgs.msg import Path
import numpy as np
from probe import maker, MODULE, planar
import pytest

KINDS = (Simulator, Manipulation, GraspAnalysisNode, PathFollower, GraspPlanner, PickAndPlace)
OBJECT = '{{shape: disc, diameter: {}, mass: 0.5, friction: 0.8}}'
#: Statuses of a loop without a fault but early joint states.
FAULTLESS = {Status.OK, Status.IDLE, Status.ACCELERATING, Status.ARRIVED, Status.HALT_NO_TWIST}
FAULTLESS |= {Status.FOLLOWING_TRAJECTORY, Status.HALT_INVALID_JOINT_STATES}
#: Noise of the tracker [m], time by which a joint state is early, and by which analyses are late,
#: and mean times until the next ones [s].
NOISE, AHEAD, LATE, EVERY = 1e-3, 0.12, 0.6, 4.0
#: Mean time that a callback takes; the loop then reaches about 30 of 100 Hz [s].
STARVED = 0.005
#: Largest distance of a target from the first pose of the object (x, y, angle) [m, rad].
REACH = (0.05, 0.05, 0.2)
PICK, PLACE = PickObject.Goal(squeeze=15.0, module=MODULE), PlaceObject.Goal(clearance=0.02)


def end_of(w, goal, send=lambda: None):
    handle = w.send_goal(goal)
    while not handle.ended:
        w.spin(0.2, send)
    return handle.result()[1]


class Course:
    """Goals for all nodes, whose messages are disturbed at random times."""

    def __init__(self, w, rng):
        self._w, self._rng, probe = w, rng, w.probe
        probe.listen(PoseStamped, 'truth', 'truth/object_pose')
        self._due = dict.fromkeys(('early', 'late'), 0.5)
        self._late_until, self._kept = 0.0, []
        self._states = probe.create_publisher(GraspState, 'grasp/state', 1)
        # The one publisher of the plant: states of a second one would be rejected.
        self._joint_states = next(
            publisher
            for node in w.nodes
            for publisher in node.publishers
            if publisher.topic_name == '/joint_states' and node is not probe
        )
        probe.create_subscription(GraspState, 'analysed', self._relay, 100)
        self.codes, self.reports = set(), set()
        w.spin(0.8, self._disturb)
        self._begin = self._true_pose()

    def _true_pose(self):
        return Pose(*planar(self._w.probe.last('truth')).tolist())

    def _relay(self, state):
        """Pass an analysis on at once, or once it is late."""
        if self._w.now < self._late_until:
            self._kept.append(state)
        else:
            self._states.publish(state)

    def _disturb(self):
        w, probe = self._w, self._w.probe
        for kind in (kind for kind, due in self._due.items() if w.now >= due):
            self._due[kind] = w.now + self._rng.exponential(EVERY)
            if kind == 'late':
                self._late_until = w.now + LATE
            elif (last := probe.last('joints')) is not None:
                early = copy.deepcopy(last)
                early.header = make_header(probe.past(-AHEAD))
                self._joint_states.publish(early)
        if w.now >= self._late_until:
            while self._kept:
                self._states.publish(self._kept.pop(0))
        self.codes |= {Status(status.code) for _, status in probe.seen['status']}
        self.reports |= {
            report.message
            for _, array in probe.seen['diagnostics']
            for report in array.status
            if report.name == 'manipulation'
        }
        for messages in probe.seen.values():
            del messages[:-1]

    def draw_motion(self):
        target = np.add(self._begin, self._rng.uniform(-1.0, 1.0, 3) * REACH)
        ends = [self._true_pose(), Pose(*target.tolist())]
        poses = [PoseStamped(pose=to_pose_message(pose)) for pose in ends]
        if self._rng.random() < 0.3:
            return FollowObjectPath.Goal(path=Path(header=make_header(0.0, 'truss'), poses=poses))
        return MoveObject.Goal(path=Path(poses=poses[1:]))

    def carry_out(self, goal):
        """Return the result of a goal; motions are drawn where it is None."""
        return end_of(self._w, goal or self.draw_motion(), self._disturb)


def check_steps(patch, goals, seed, sim_time, is_held):
    """Carry out goals; check that none of them is aborted, and that no fault is reported."""
    rng = np.random.default_rng(seed)
    body = OBJECT.format(0.3 if is_held else 0.2)
    shared = {'command_timeout': 0.5, 'object': body, 'use_sim_time': sim_time}
    plant = {'plant': 'elastic', 'tracker_noise': NOISE, 'tracker_rate': 30.0, 'seed': seed}
    plant |= {'indentation': 0.012, 'object_is_free': not is_held, 'object_pose': [0.6, 0.3, 0.0]}
    plant |= {'grip_module': MODULE, 'clock_speed': 1.0 if sim_time else 0.0}
    settings = {
        'simulator': plant,
        'manipulation': {'squeeze_force': 8.0 * is_held, 'grip_module': MODULE},
        'grasp_analysis': {'rate': 10.0},
        'path_follower': {'rate': 50.0},
    }
    nodes = [maker(kind)(**shared, **settings.get(kind.node_name, {})) for kind in KINDS]
    remaps = {('grasp_analysis', '/grasp/state'): '/analysed'}
    with world(*nodes, sim_time=sim_time, remaps=remaps, enter=lambda w: connect(w, patch)) as w:
        if not sim_time:
            w.busy = lambda: rng.exponential(STARVED)
        course = Course(w, rng)
        results = [course.carry_out(goal) for goal in goals]
        assert [result.message for result in results if result.code != 0] == []
        assert course.codes <= FAULTLESS
        if not sim_time:
            assert any('the loop reaches ' in words for words in course.reports)
        assert not [words for words in course.reports if 'slip' in words or 'oscillat' in words]


@pytest.mark.nightly
@pytest.mark.parametrize(('goals', 'sim_time'), [((PLACE,), False), ((None, PLACE), True)])
def test_a_held_object_is_moved_and_placed_in_spite_of_disturbances(monkeypatch, goals, sim_time):
    check_steps(monkeypatch, goals, 1, sim_time, is_held=True)


@pytest.mark.nightly
@pytest.mark.parametrize(('seed', 'sim_time'), [(k, k % 2 == 0) for k in range(4)])
def test_of_forty_disturbed_steps_none_is_aborted(monkeypatch, seed, sim_time):
    goals = (PICK, None, None, None, PLACE, PICK, None, None, None, PLACE)
    check_steps(monkeypatch, goals, seed, sim_time, is_held=False)


FEATURES = 'corner_radius: 0.02, mass: 0.5, friction: 0.8'
SHAPES = {
    'ellipse': '{shape: ellipse, semi_axes: [0.12, 0.1], mass: 0.5, friction: 0.8}',
    'box': '{shape: polygon, vertices: [[-0.12, -0.1], [0.12, -0.1], [0.12, 0.1], [-0.12, 0.1]],'
    f'{FEATURES}}}',
    'hexagon': '{shape: polygon, vertices: [[0.12, 0], [0.06, 0.104], [-0.06, 0.104], [-0.12, 0],'
    f'[-0.06, -0.104], [0.06, -0.104]], {FEATURES}}}',
}


@pytest.mark.nightly
@pytest.mark.parametrize(('shape', 'seed'), [('ellipse', 0), ('box', 3), ('hexagon', 0)])
def test_an_object_is_picked_where_it_was_placed(monkeypatch, shape, seed):
    rng = np.random.default_rng(seed)
    start = np.array([0.6, 0.3, 0.0]) + rng.uniform(-1.0, 1.0, 3) * (0.03, 0.03, 3.0)
    target = start + rng.uniform(-1.0, 1.0, 3) * (0.04, 0.04, 0.1)
    shared = {'command_timeout': 0.5, 'object': SHAPES[shape]}
    plant = {'plant': 'elastic', 'object_is_free': True, 'object_pose': start.tolist()}
    nodes = [maker(k)(**shared, **(plant if k is Simulator else {})) for k in KINDS]
    path = Path(poses=[PoseStamped(pose=to_pose_message(Pose(*target.tolist())))])
    with world(*nodes, enter=lambda w: connect(w, monkeypatch)) as w:
        w.spin(1.0)
        for goal in (PICK, MoveObject.Goal(path=path), PLACE, PICK):
            result = end_of(w, goal)
            assert result.code == 0, result.message
            if isinstance(goal, MoveObject.Goal):
                assert np.hypot(*(w.place() - target)[:2]) < 1e-2
