# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Sequences of a pick, a correction and a release, and goals of all nodes in spite of faults.

In the latter, nodes are starved of processor time as well: each callback takes a random time.
"""

import copy
import math
from types import SimpleNamespace

from contracts import check_fields
from geometry_msgs.msg import PoseStamped
from isotruss_msgs import action
from isotruss_msgs.action import FollowObjectPath, MoveObject, PickObject, PlaceObject
from isotruss_msgs.msg import GraspState, ManipulationStatus, PlannedGrasp
from isotruss_ros.core import ConvexObject, Pose, Status, tangent_center
from isotruss_ros.core.inputs import LatestInputs, StampedInput
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.planning.grasp_plan import NEAR_SPEED_SHARE
from isotruss_ros.nodes.conversions.messages import make_header, read_pose, to_pose_message
from isotruss_ros.nodes.conversions.path_messages import read_duration, to_trajectory_message
from isotruss_ros.nodes.grasp_analysis import GraspAnalysisNode
from isotruss_ros.nodes.grasp_planner import GraspPlanner
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.path_follower import PathFollower
from isotruss_ros.nodes.pick_and_place import action_steps
from isotruss_ros.nodes.pick_and_place.grasp_sequences import GraspSequences
from isotruss_ros.nodes.pick_and_place.node import PickAndPlace
from isotruss_ros.nodes.pick_and_place.object_watch import (
    AveragePose,
    CONFIRMATION_TIMEOUT,
    ObjectWatch,
)
from isotruss_ros.nodes.simulator.node import Simulator
from manual_actions import connect, MotionClient, replace_clients
from manual_world import world
from nav_msgs.msg import Path
from nightly import some_now
import numpy as np
from probe import CENTER, DIAMETER, maker, manipulation, MODULE, planar, ROBOT
import pytest

NOISE, DISPLACEMENT = 1e-3, 8e-3
FIRST = AveragePose(Pose(*CENTER, 0.3), NOISE, 25)
SQUEEZED = tangent_center(ROBOT.home, MODULE, DIAMETER, shift=0.01)


def replace_servers(monkeypatch, result):
    """Return the client whose goals end with a result, in place of those of all actions."""
    client = MotionClient(result)
    replace_clients(monkeypatch, action_steps, lambda *_: client)
    return client


@pytest.fixture
def correct(monkeypatch):
    """Return a function that corrects a displacement, and returns its note and goal."""
    result = action.FollowObjectPath.Result(code=action.FollowObjectPath.Result.REACHED)
    client = replace_servers(monkeypatch, result)

    def run(displacement, noise, seed=0):
        random = np.random.default_rng(seed)
        with world(maker(PickAndPlace, command_timeout=1.0)()) as w:
            node = w.nodes[1]

            def send():
                center = CENTER + random.normal((0.0, displacement), noise)
                w.probe.send_measured(center=center)

            w.spin(0.1, send)
            steps = GraspSequences(node, ROBOT, ObjectWatch(node, node.inputs)).bring_back(FIRST)
            while True:
                try:
                    next(steps)
                except StopIteration as end:
                    return end.value, client.goal
                w.spin(0.02, send)

    return run


@pytest.mark.parametrize('seed', some_now(range(2)))
def test_a_path_from_the_mean_admits_noisy_readings(correct, seed):
    _, goal = correct(DISPLACEMENT, NOISE, seed)
    begin = read_pose('begin', goal.path.poses[0].pose)
    assert begin[:2] == pytest.approx((CENTER[0], CENTER[1] + DISPLACEMENT), abs=5e-4)
    there = CENTER[0], CENTER[1] + DISPLACEMENT
    readings = np.random.default_rng(99).normal(there, NOISE, (2000, 2))
    off = np.hypot(*(readings - begin[:2]).T)
    assert (off > goal.position_tolerance).mean() < 1e-3


def test_a_displacement_within_noise_is_not_corrected(correct):
    assert correct(1.2e-3, 10e-3) == ('', None)


def test_the_note_has_the_deviation_of_the_means(correct):
    note, _ = correct(DISPLACEMENT, NOISE)
    assert 'displaced the object by 8' in note
    # The noise of a mean of 25 poses is a fifth of that of one.
    deviation = float(note.split('deviation ')[1].split()[0])
    assert deviation == pytest.approx(1e3 * NOISE * math.sqrt(2.0 / 25.0), rel=0.4)


def test_mean_of_poses_beside_half_a_turn_is_there():
    mean = AveragePose.of([Pose(0.0, 0.0, 3.1), Pose(0.0, 2.0, -3.1)])
    assert abs(mean.pose.angle) == pytest.approx(math.pi)
    assert mean.pose[:2] == pytest.approx((0.0, 1.0))
    assert mean.noise == pytest.approx(math.sqrt(2.0))


def send_held(w):
    """Return a call that sends measured states, and that the object is held."""

    def send():
        w.probe.send_measured(center=SQUEEZED)
        w.probe.send_held(GraspState.HELD_YES, ['north/P-Z', 'north/Z-R'])

    return send


def test_stage_and_progress_of_a_release_are_those_of_its_trajectory(monkeypatch):
    client, reports = replace_servers(monkeypatch, None), []
    with world(maker(PickAndPlace, command_timeout=1.0)()) as w:
        w.spin(0.1, send_held(w))
        goal = w.send_goal(action.PlaceObject.Goal())
        w.until(lambda: client.goal is not None, send_held(w))
        points = client.goal.trajectory.points
        for client.desired in points:
            w.spin(0.06, send_held(w))
            reports.append((goal.feedback[-1].stage, goal.feedback[-1].progress))
    assert reports == sorted(reports)
    stages, progress = np.transpose(reports)
    apart = stages.tolist().index(action.PlaceObject.Feedback.BACKING_OFF)
    assert {*stages[:apart]} == {action.PlaceObject.Feedback.OPENING}
    assert progress[[0, apart - 1, -1]] == pytest.approx([0.0, 1.0, 1.0])


def test_grip_opens_slowly_until_the_object_is_free_and_its_displacement_is_known(monkeypatch):
    client = replace_servers(monkeypatch, action.FollowRollerTrajectory.Result())
    with world(maker(PickAndPlace, command_timeout=1.0, friction=0.8)()) as w:
        send = send_held(w)
        w.spin(0.1, send)
        refusals = action.PlaceObject.Result
        for fields, code, words in (
            ({'max_rotation': 1e-9}, refusals.NO_MOTION_FOUND, 'turns the object by'),
            ({'max_rotation': math.nan}, refusals.BAD_GOAL, 'max_rotation'),
            ({'clearance': math.nan}, refusals.BAD_GOAL, 'clearance'),
            ({'clearance': -1.0}, refusals.BAD_GOAL, 'clearance'),
        ):
            _, refused = w.finish(w.send_goal(action.PlaceObject.Goal(**fields)), send)
            assert refused.code == code
            assert words in refused.message
        goal = w.send_goal(action.PlaceObject.Goal(clearance=0.05))
        w.until(lambda: client.goal is not None, send)

        def send_released():
            w.probe.send_joints()
            w.probe.send_object((SQUEEZED[0] + 0.003, SQUEEZED[1] - 0.004, 0.3 + 0.1))
            w.probe.send_held(GraspState.HELD_NO)

        _, result = w.finish(goal, send_released)
    expected = {'code': 0, 'message': result.message, 'stamp': result.stamp}
    released = w.probe.last('pose').pose
    expected |= {'held': GraspState.HELD_NO}
    expected |= {'object_pose': (result.object_pose.header, released)}
    expected |= {'displacement': 0.005, 'rotation': 0.1, 'violated_requirement': ''}
    check_fields(result, expected | {'violation_value': 0.0, 'violation_bound': 0.0})
    points = client.goal.trajectory.points
    opened = ROBOT.configuration(points[-1].positions)
    gap = -member_depths(opened, ConvexObject.disc(SQUEEZED, DIAMETER)).max()
    assert gap == pytest.approx(0.05, abs=2e-3)
    times = [read_duration(point.time_from_start) for point in points]
    steps = np.diff([point.positions for point in points], axis=0)
    speeds = np.abs(steps).max(axis=1) / np.diff(times)
    fastest = ROBOT.description.max_speed
    assert speeds[0] < 1.001 * NEAR_SPEED_SHARE * fastest
    assert speeds.max() > 2.0 * NEAR_SPEED_SHARE * fastest


def test_a_pick_sets_the_grip_and_reports_the_mean_squeeze_and_a_move_its_failure(monkeypatch):
    module, members = 'south/Q', ['south/P-Q', 'south/Q-R']
    path = to_trajectory_message(ROBOT, [[0.0] * 6, [0.01] * 6], [0.0, 1.0])
    grasp = PlannedGrasp(module=module, squeeze=14.0, path=path)
    results = {
        action.PlanGrasp: action.PlanGrasp.Result(grasps=[grasp]),
        action.FollowRollerTrajectory: action.FollowRollerTrajectory.Result(),
        action.FollowObjectPath: action.FollowObjectPath.Result(
            code=action.FollowObjectPath.Result.BAD_GOAL
        ),
    }

    def enter(w):
        connect(w, monkeypatch)
        clients = {kind: MotionClient(result) for kind, result in results.items()}
        replace_clients(monkeypatch, action_steps, lambda _, kind, __: clients[kind])

    makers = maker(PickAndPlace, command_timeout=1.0)(), manipulation()
    with world(*makers, enter=enter) as w:
        grip = w.nodes[2].values

        def send():
            w.probe.send_measured()
            held = GraspState.HELD_YES if grip.squeeze_force else GraspState.HELD_NO
            fields = {'squeeze': [10.0, 20.0], 'squeeze_deviation': 2.0, 'squeeze_assumed': True}
            w.probe.send_held(held, members, **fields, slip_margin=1.5)

        def result_of(goal):
            w.spin(0.1, send)
            return w.finish(w.send_goal(goal), send)[1]

        picked, again = result_of(action.PickObject.Goal()), result_of(action.PickObject.Goal())
        assert (grip.squeeze_force, grip.grip_module) == (14.0, module)
        expected = {'code': 0, 'message': picked.message, 'stamp': picked.stamp}
        expected |= {'held': GraspState.HELD_YES, 'module': module, 'members': members}
        expected |= {'squeeze': 15.0, 'squeeze_deviation': 2.0, 'squeeze_assumed': True}
        expected |= {'slip_margin': 1.5, 'violated_requirement': ''}
        check_fields(picked, expected | {'violation_value': 0.0, 'violation_bound': 0.0})
        assert f'held at {module}, squeeze unknown' in picked.message
        assert (again.code, again.held) == (again.BAD_GOAL, GraspState.HELD_YES)
        assert again.message.startswith('the object is already held by south/P-Q, south/Q-R')
        assert result_of(action.MoveObject.Goal()).code == action.MoveObject.Result.BAD_GOAL


@pytest.mark.parametrize(
    ('planned', 'code'),
    [
        (action.PlanGrasp.Result.NONE_FOUND, action.PickObject.Result.NO_MOTION_FOUND),
        (action.PlanGrasp.Result.FAILED, action.PickObject.Result.STOPPED),
        (action.PlanGrasp.Result.NO_JOINT_STATES, action.PickObject.Result.NOT_READY),
    ],
)
def test_pick_searches_as_its_goal_requires_and_reports_the_violation(monkeypatch, planned, code):
    violation = {'violated_requirement': 'slip_margin', 'violation_value': 1.0}
    violation |= {'violation_bound': 2.0, 'message': 'none found'}
    client = replace_servers(monkeypatch, action.PlanGrasp.Result(code=planned, **violation))
    fields = {'module': MODULE, 'squeeze': 14.0, 'min_slip_margin': 2.0, 'time_limit': 3.0}
    with world(maker(PickAndPlace, command_timeout=1.0, friction=0.7)()) as w:
        _, unready = w.finish(w.send_goal(action.PickObject.Goal()))
        assert unready.code == action.PickObject.Result.NOT_READY
        w.spin(0.1, w.probe.send_measured)
        goal = w.send_goal(action.PickObject.Goal(**fields, members=['north/P-Z']))
        (_, result), asked = w.finish(goal, w.probe.send_measured), client.goal
    assert result.code == code
    assert {name: getattr(result, name) for name in violation} == violation
    assert {name: getattr(asked, name) for name in fields} == fields
    assert (asked.friction, asked.object_diameter, asked.count) == (0.7, DIAMETER, 1)
    assert asked.members == ['north/P-Z']
    assert read_pose('pose', asked.object_pose.pose) == pytest.approx((*CENTER, 0.3))


NO, YES, UNKNOWN = GraspState.HELD_NO, GraspState.HELD_YES, GraspState.HELD_UNKNOWN
TIMEOUT, STEP = 0.5, 0.125
SILENT = None
NOT_HELD, STOPPED = MoveObject.Result.NOT_HELD, MoveObject.Result.STOPPED


class Mover:
    """An object that `pick_and_place` moves, while a test publishes whether it is held."""

    def __init__(self, w):
        self.w = w
        self._statuses = w.probe.create_publisher(ManipulationStatus, 'manipulation/status', 1)
        self.report(YES, SILENT, 0.1)
        poses = [Pose(*CENTER, 0.0), Pose(CENTER[0] + 0.03, CENTER[1] - 0.04, 0.2)]
        path = Path(poses=[PoseStamped(pose=to_pose_message(pose)) for pose in poses])
        self._goal = w.send_goal(MoveObject.Goal(path=path, speed=0.02, turn_rate=0.3))
        self.report(YES, SILENT, 0.1)
        assert not self._goal.ended

    def report(self, analysis, loop, duration):
        """Publish for some time what the analysis and the control loop report."""

        def send():
            self.w.probe.send_measured()
            if analysis is not SILENT:
                words = 'joint states: stamped 0.1 s in the future'
                self.w.probe.send_held(analysis, message=words)
            if loop is not SILENT:
                header = make_header(self.w.probe.past(0.0), 'truss')
                self._statuses.publish(
                    ManipulationStatus(header=header, held=loop, message='lost')
                )

        self.w.spin(duration, send)

    @property
    def result(self):
        """Return the result of the motion; None while it goes on."""
        return self._goal.result()[1] if self._goal.ended else None


@pytest.fixture
def mover(monkeypatch):
    """Return a moved object; its motion ends only when it is cancelled."""
    client = MotionClient()
    replace_clients(monkeypatch, action_steps, lambda *_: client)
    with world(maker(PickAndPlace, command_timeout=TIMEOUT)()) as w:
        yield Mover(w)
    assert (client.goal.speed, client.goal.turn_rate) == (0.02, 0.3)


@pytest.mark.parametrize(
    'reports',
    [[(UNKNOWN, SILENT, 0.8), (YES, SILENT, 0.2), (UNKNOWN, SILENT, 0.8)], [(SILENT, YES, 4.0)]],
    ids=['analysis without result', 'late analysis while the loop holds the object'],
)
def test_motion_continues_while_no_hold_is_unknown_for_the_timeout(mover, reports):
    for analysis, loop, timeouts in reports:
        mover.report(analysis, loop, timeouts * TIMEOUT)
    assert mover.result is None


@pytest.mark.parametrize(
    ('analysis', 'loop', 'timeouts', 'code', 'words'),
    [
        (NO, SILENT, 0.1, NOT_HELD, ''),
        (YES, NO, 0.1, NOT_HELD, 'lost'),
        (UNKNOWN, SILENT, 1.1, STOPPED, 'unknown whether the object is held: joint states'),
    ],
    ids=['loss by the analysis', 'loss by the loop', 'unknown'],
)
def test_motion_ends_at_once_after_a_loss_and_after_the_timeout_of_an_unknown_hold(
    mover, analysis, loop, timeouts, code, words
):
    mover.report(analysis, loop, timeouts * TIMEOUT)
    assert (mover.result.code, mover.result.held) == (code, NO if code == NOT_HELD else UNKNOWN)
    assert words in mover.result.message
    expected = {'code': code, 'message': mover.result.message, 'stamp': mover.result.stamp}
    expected |= {'held': NO if code == NOT_HELD else UNKNOWN}
    # The probe has the object at an angle of 0.3 rad.
    expected |= {'position_error': 0.05, 'angle_error': 0.1}
    there, measured = mover.result.object_pose, mover.w.probe.last('pose').pose
    assert there.header.frame_id == 'truss'
    check_fields(mover.result, expected | {'object_pose': (there.header, measured)})


def test_analysis_of_joint_states_from_the_future_is_no_loss():
    with world(maker(GraspAnalysisNode)()) as w:
        w.until(
            lambda: bool(w.code('state')),
            lambda: (w.probe.send_joints(age=-0.3), w.probe.send_pose()),
        )
        assert w.probe.last('state').held == UNKNOWN


@pytest.mark.parametrize('grip_delay', [0.3, math.inf])
def test_a_confirmed_grasp_has_the_deviation_of_a_grip_published_within_the_timeout(grip_delay):
    clock, inputs = [0.0], LatestInputs()
    values = SimpleNamespace(command_timeout=TIMEOUT)
    node = SimpleNamespace(now=lambda: clock[0], values=values)
    inputs.grasp = StampedInput(GraspState(held=YES, squeeze_deviation=1.0), 0.0)
    steps = ObjectWatch(node, inputs).confirm(True)
    next(steps)
    confirmed = None
    while confirmed is None:
        clock[0] += STEP
        deviation = 2.0 if clock[0] > grip_delay else math.nan
        inputs.grasp = StampedInput(GraspState(held=YES, squeeze_deviation=deviation), clock[0])
        try:
            next(steps)
        except StopIteration as end:
            confirmed = end.value
    assert clock[0] == pytest.approx(min(grip_delay, CONFIRMATION_TIMEOUT), abs=2.0 * STEP)
    assert math.isnan(confirmed.squeeze_deviation) == math.isinf(grip_delay)


KINDS = (Simulator, Manipulation, GraspAnalysisNode, PathFollower, GraspPlanner, PickAndPlace)
OBJECT = '{{shape: disc, diameter: {}, mass: 0.5, friction: 0.8}}'
#: Statuses of a loop without a fault but early joint states.
FAULTLESS = {Status.OK, Status.IDLE, Status.ACCELERATING, Status.ARRIVED, Status.HALT_NO_TWIST}
FAULTLESS |= {Status.FOLLOWING_TRAJECTORY, Status.HALT_INVALID_JOINT_STATES}
#: Noise of the tracker [m], time by which a joint state is early, and by which analyses are late,
#: and mean times until the next ones [s].
JITTER, AHEAD, LATE, EVERY = 1e-3, 0.12, 0.6, 4.0
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
        result = end_of(self._w, goal or self.draw_motion(), self._disturb)
        if 'rejected: joint states: stamped' in result.message:
            # A trajectory that arrives just after an early state is refused; it is sent again.
            return self.carry_out(goal)
        return result


def check_steps(patch, goals, seed, sim_time, is_held):
    """Carry out goals; check that none of them is aborted, and that no fault is reported."""
    rng = np.random.default_rng(seed)
    body = OBJECT.format(0.3 if is_held else 0.2)
    shared = {'command_timeout': 0.5, 'object': body, 'use_sim_time': sim_time}
    plant = {
        'plant': 'elastic',
        'tracker_noise': JITTER,
        'tracker_rate': 30.0,
        'seed': seed,
    }
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
