# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pick, move and place with all nodes as processes: the object is where it should be, at rest."""

from collections.abc import Iterable
import math
from pathlib import Path
import re
import signal
import subprocess
import sys
import time

from action_msgs.msg import GoalInfo, GoalStatus
from geometry_msgs.msg import PoseStamped, TwistStamped
from isotruss_msgs.action import MoveObject, PickObject, PlaceObject, PlanGrasp
from isotruss_ros.core import Pose, Status
from isotruss_ros.nodes.conversions.messages import read_stamp, to_pose_message
from nav_msgs.msg import Path as PathMessage
import numpy as np
from probe import Probe
import pytest
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.clock import Clock, ClockType
from rclpy.qos import QoSProfile
from robot_processes import robot
from robots import quick_robot

#: Step of the clock, at most in real time [s].
STEP = 0.01
#: Largest ages of the last message of each source, two periods of its node [s].
LARGEST_AGES = {'joints': 0.04, 'status': 0.04, 'twist': 0.04, 'state': 0.1}
#: Wall time after which a source without messages is not awaited until its next one [s].
PATIENCE = 2.0


class PacedClock:
    """
    Publishes `/clock`: a step after all nodes that publish have published for the last ones.

    :param probe: probe by simulated time, which hears the nodes.
    :param nodes: names of the nodes; the first step is when all of them hear the clock.
    """

    def __init__(self, probe: Probe, nodes: Iterable[str]) -> None:
        self._probe, self._time, self._stepped = probe, 0.0, time.monotonic()
        self._deaf = set(nodes)
        self._silent = dict.fromkeys(LARGEST_AGES, 0)
        probe.listen(TwistStamped, 'twist', 'cmd_vel')
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        probe.create_timer(0.2 * STEP, self._advance, clock=steady)

    def _advance(self) -> None:
        if self._deaf:
            infos = self._probe.get_subscriptions_info_by_topic('/clock')
            self._deaf -= {info.node_name for info in infos}
            return
        waited = time.monotonic() - self._stepped
        late = [key for key in LARGEST_AGES if self._is_late(key)]
        if waited < STEP or (late and waited < PATIENCE):
            return
        for key in late:
            self._silent[key] = len(self._probe.seen[key])
        self._time, self._stepped = self._time + STEP, time.monotonic()
        self._probe.tick(self._time)

    def _is_late(self, key: str) -> bool:
        """Return whether the last message of a source, if it publishes, is too old."""
        count = len(self._probe.seen[key])
        if count == self._silent[key]:
            return False
        stamp = read_stamp(self._probe.last(key).header)
        return math.isfinite(stamp) and self._time - stamp > LARGEST_AGES[key]


pytestmark = [pytest.mark.system, pytest.mark.xdist_group('pick and place')]

ACTIONS = {PickObject: 'pick_object', MoveObject: 'move_object', PlaceObject: 'place_object'}
CENTER, DIAMETER, FRICTION = (0.6, 0.3), 0.2, 0.5
#: An object that is at one of them, by an earlier test, is moved to the other.
DESTINATIONS = (0.58, 0.34), CENTER
#: A goal ends when inputs are late, and a busy machine delays them.
PATIENT = {'command_timeout': 4.0}
#: Time waits for the nodes: what they do is the same on a busy machine.
PACED = {'use_sim_time': True, 'use_stamped_twist': True, 'command_timeout': 10.0}
#: Rollers whose commands are late stop soon, and push no object away meanwhile.
STOPPING = {'command_timeout': 0.2}
#: Whether or not the middleware has noticed that the node was gone for a while.
ENDED = re.compile('has lost the goal|no node offers the action|has sent no feedback for')
#: With so much progress the node under the goal has begun.
BEGUN = 0.05
PICK = PickObject.Goal(squeeze=15.0, module='north/Z')
#: Takes some time to plan: any module, any squeeze.
SEARCHED = PickObject.Goal()
#: So far that a pick approaches for some time.
APART = PlaceObject.Goal(clearance=0.05)
#: Objects that are carried in four ways each, see `test_an_object_is_picked_where_it_was_placed`.
SHAPES = {
    'disc': '{shape: disc, diameter: 0.2, mass: 0.5, friction: 0.8}',
    'ellipse': '{shape: ellipse, semi_axes: [0.12, 0.1], mass: 0.5, friction: 0.8}',
    'box': '{shape: polygon, vertices: [[-0.12, -0.1], [0.12, -0.1], [0.12, 0.1], [-0.12, 0.1]],'
    ' corner_radius: 0.02, mass: 0.5, friction: 0.8}',
    'hexagon': '{shape: polygon, vertices: [[0.12, 0], [0.06, 0.104], [-0.06, 0.104], [-0.12, 0],'
    ' [-0.06, -0.104], [0.06, -0.104]], corner_radius: 0.02, mass: 0.5, friction: 0.8}',
}
DRAWS = 6
#: Fails without a motion, as soon as all nodes have discovered each other.
READY = PickObject.Goal(squeeze=1e5, time_limit=0.2)
#: There is no such grasp; or a grip that was closing when its node was killed holds the object.
ANSWERS = {PickObject.Result.NO_MOTION_FOUND, PickObject.Result.BAD_GOAL}


class Client:
    """Sends goals to all nodes of a picking robot."""

    def __init__(self, r, pose=(*CENTER, 0.0), **described):
        self.r = r
        patient = PATIENT | {'robot': quick_robot()}
        shared = patient | {'object_diameter': DIAMETER, 'friction': FRICTION} | described
        lying = {'plant': 'elastic', 'object_is_free': True, 'object_pose': list(map(float, pose))}
        self._values = {
            'simulator': {'rate': 50.0, **shared, **STOPPING, **lying},
            'manipulation': {'rate': 50.0, **shared},
            'grasp_analysis': {'rate': 20.0, **shared},
            'path_follower': {'rate': 50.0, **shared},
            'grasp_planner': {**patient, **described},
            'pick_and_place': shared,
        }
        for name in self._values:
            self.start(name)
        # Ten messages, as by default, are fewer than come while a busy machine holds this process.
        every = QoSProfile(depth=1000)
        self._clients = {
            kind: ActionClient(r.w.probe, kind, name, feedback_sub_qos_profile=every)
            for kind, name in ACTIONS.items()
        }
        self.feedback = []

    def start(self, name):
        """Start a node."""
        self.r.start(name, **self._values[name])

    def restart(self, name):
        """Kill a node, and start it again."""
        self.r.signal(name, signal.SIGKILL)
        self.start(name)

    def hold(self):
        """Pick the object up, unless it is held."""
        if not self.r.w.probe.last('held').data:
            assert self.execute(PICK)[1].code == 0

    def let_go(self):
        """Place the object, if members press on it."""
        if len(self.r.w.probe.last('state').grasping_members) > 1:
            assert self.execute(APART)[1].code == 0

    def begin(self, goal):
        """Send a goal; return its handle."""
        (kind,) = (kind for kind in ACTIONS if isinstance(goal, kind.Goal))
        client = self._clients[kind]
        self.r.w.until(client.server_is_ready)
        # A server that answers has discovered the client; a goal cannot be sent again, as it is
        # carried out even where its answer is lost.
        self.r.w.ask(ClientGoalHandle(client, GoalInfo().goal_id, None).get_result_async)
        self.feedback.clear()
        sent = client.send_goal_async(goal, lambda m: self.feedback.append(m.feedback))
        self._until(sent.done)
        return sent.result()

    def end(self, handle):
        """Return status and result of a goal."""
        found = self.r.w.ask(handle.get_result_async)
        return found.status, found.result

    def execute(self, goal):
        """Send a goal, return how it ends; again while nodes have not discovered each other."""
        status, result = self.end(self.begin(goal))
        for _ in range(30):
            started = 'none received yet' not in result.message
            if started and result.code != PickObject.Result.NOT_READY:
                break
            self.r.w.spin(0.5)
            status, result = self.end(self.begin(goal))
        return status, result

    def until_stage(self, goal, stage, progress=0.0):
        """Send a goal, and return its handle in a stage, with so much of it done."""
        handle, ended = self._begin_stage(goal, stage, progress)
        assert not ended.done(), ended.result().result.message
        return handle

    def _begin_stage(self, goal, stage, progress):
        """Send a goal; return its handle and the future of its end, one of which comes first."""
        handle = self.begin(goal)
        ended = handle.get_result_async()
        self._until(
            lambda: (
                ended.done()
                or any(m.stage == stage and m.progress >= progress for m in self.feedback)
            )
        )
        return handle, ended

    def until_moving(self, speed):
        """Send a goal to move the held object far enough; return its handle, and the goal."""
        self.hold()
        here = self.place()
        # It ends well as soon as a path follower that was started again has been discovered.
        assert self.execute(MoveObject.Goal(path=path_to(*here)))[1].code == 0
        far = max(DESTINATIONS, key=lambda there: np.hypot(*(here - there)))
        moving = MoveObject.Goal(path=path_to(*far), speed=speed)
        return self.until_stage(moving, MoveObject.Feedback.MOVING, progress=BEGUN), moving

    def until_searching(self):
        """Send a goal, and return its handle once the planner searches."""
        probe = self.r.w.probe
        probe.listen(PlanGrasp.Impl.FeedbackMessage, 'search', 'plan_grasp/_action/feedback')
        handle = self.begin(SEARCHED)
        self._until(lambda: probe.seen['search'])
        return handle

    def until_approaching(self):
        """Send a goal, and return its handle once the rollers move; again if they were near."""
        for _ in range(3):
            handle, ended = self._begin_stage(PICK, PickObject.Feedback.APPROACHING, BEGUN)
            if not ended.done():
                return handle
            self.hold()
            self.let_go()
        raise AssertionError(ended.result().result.message)

    def cancel_in_stage(self, goal, stage, back, progress):
        """Cancel a goal in a stage, in which others are refused; again where that was over."""
        for _ in range(10):
            handle = self.until_stage(goal, stage, progress)
            other = self.begin(goal)
            handle.cancel_goal_async()
            status, result = self.end(handle)
            if status == GoalStatus.STATUS_CANCELED:
                assert 'cancelled' in result.message
                assert 'has been executed for ' in self.end(other)[1].message
                return
            assert status == GoalStatus.STATUS_SUCCEEDED, result.message
            self.end(other)
            assert self.execute(back)[1].code == 0
        raise AssertionError(f'stage {stage} was always over before the goal was cancelled')

    def place(self):
        """Return where the object is, by a message that was sent after this call."""
        now = self.r.w.probe.past(0.0)

        def arrived():
            pose = self.r.w.probe.last('pose')
            return pose is not None and read_stamp(pose.header) > now

        self._until(arrived)
        position = self.r.w.probe.last('pose').pose.position
        return np.array([position.x, position.y])

    def _until(self, what):
        self.r.w.until(what)


def path_to(x, y, angle=0.0):
    """Return a path of one pose."""
    pose = PoseStamped(pose=to_pose_message(Pose(x, y, angle)))
    return PathMessage(poses=[pose])


@pytest.fixture(scope='module')
def client(shared_domain, tmp_path_factory):
    """Return a client of all nodes, for the tests that leave all of them running."""
    with robot(tmp_path_factory.mktemp('nodes')) as r:
        client = Client(r)
        assert client.execute(READY)[1].code in ANSWERS
        r.w.until(lambda: r.w.probe.last('held') and r.w.probe.last('state'))
        yield client


@pytest.mark.nightly
@pytest.mark.parametrize('draw', range(DRAWS))
@pytest.mark.parametrize('shape', SHAPES)
def test_an_object_is_picked_where_it_was_placed(tmp_path, shape, draw):
    rng = np.random.default_rng([draw, list(SHAPES).index(shape)])
    lies = np.array([*CENTER, 0.0]) + rng.uniform(-1.0, 1.0, 3) * (0.03, 0.03, 3.0)
    there = lies + rng.uniform(-1.0, 1.0, 3) * (0.04, 0.04, 0.1)
    file = tmp_path / 'object.yaml'
    file.write_text(SHAPES[shape], encoding='utf-8')
    with robot(tmp_path, sim_time=True, twist_type=TwistStamped) as r:
        client = Client(r, lies.tolist(), object=str(file), **PACED)
        PacedClock(r.w.probe, r.alive)
        for goal in (PICK, MoveObject.Goal(path=path_to(*there)), APART, PICK):
            status, result = client.execute(goal)
            assert (status, result.code) == (GoalStatus.STATUS_SUCCEEDED, 0), result.message
            if isinstance(goal, MoveObject.Goal):
                assert np.hypot(*(client.place() - there[:2])) < 1e-2


@pytest.mark.nightly
@pytest.mark.parametrize(
    ('stage', 'progress'),
    [
        (PickObject.Feedback.PLANNING, 0.0),
        (PickObject.Feedback.APPROACHING, 0.0),
        # A grip that only begins to close does not press yet.
        (PickObject.Feedback.CLOSING, 0.3),
    ],
    ids=['planning', 'approaching', 'closing'],
)
def test_a_cancel_of_a_pick_leaves_the_robot_at_rest(client, stage, progress):
    client.let_go()
    client.cancel_in_stage(PICK, stage, PlaceObject.Goal(), progress)
    client.r.check_rests()
    if stage == PickObject.Feedback.CLOSING:
        # A grip that is half closed opens again.
        assert client.execute(APART)[1].code == 0


@pytest.mark.nightly
def test_a_pick_ends_with_a_pick_and_place_that_is_killed(client):
    client.let_go()
    r = client.r
    client.until_approaching()
    client.restart('pick_and_place')
    r.w.until(lambda: r.w.code() == Status.HALT_TRAJECTORY)
    assert 'the client that supervises the goal' in r.w.probe.last('status').message
    r.check_rests()
    assert client.execute(READY)[1].code in ANSWERS


@pytest.mark.parametrize(
    'name', [pytest.param('grasp_planner', marks=pytest.mark.nightly), 'manipulation']
)
def test_a_pick_ends_where_a_node_under_it_is_killed_and_started_again(client, name):
    client.let_go()
    handle = client.until_searching() if name == 'grasp_planner' else client.until_approaching()
    client.restart(name)
    status, result = client.end(handle)
    assert (status, result.code) == (GoalStatus.STATUS_ABORTED, PickObject.Result.STOPPED)
    assert ENDED.search(result.message)
    client.r.check_rests()
    assert client.execute(READY)[1].code in ANSWERS


@pytest.mark.nightly
def test_a_cancel_ends_the_goal_where_a_node_under_it_hangs(client):
    client.let_go()
    handle = client.until_searching()
    client.r.signal('grasp_planner', signal.SIGSTOP)
    handle.cancel_goal_async()
    status, result = client.end(handle)
    assert (status, result.code) == (GoalStatus.STATUS_CANCELED, PickObject.Result.CANCELLED)
    client.r.signal('grasp_planner', signal.SIGCONT)
    assert client.execute(PICK)[1].code == 0


@pytest.mark.nightly
def test_a_motion_ends_where_a_node_under_it_is_killed_and_started_again(client):
    handle, moving = client.until_moving(0.005)
    client.restart('path_follower')
    status, result = client.end(handle)
    assert (status, result.code) == (GoalStatus.STATUS_ABORTED, MoveObject.Result.STOPPED)
    assert ENDED.search(result.message)
    assert 0.01 < result.position_error < 0.05
    assert read_stamp(result) > read_stamp(result.object_pose.header) > 0.0
    client.r.check_rests()
    assert client.execute(moving)[1].code == 0


@pytest.mark.nightly
@pytest.mark.parametrize('name', ['manipulation', 'path_follower'])
def test_a_motion_ends_one_timeout_after_a_node_under_it_is_killed(client, name):
    handle, _ = client.until_moving(0.005)
    client.r.signal(name, signal.SIGKILL)
    killed = time.monotonic()
    status, result = client.end(handle)
    took = time.monotonic() - killed
    client.start(name)
    assert (status, result.code) == (GoalStatus.STATUS_ABORTED, MoveObject.Result.STOPPED)
    # Less than half of `progress_timeout`, which is for a robot that does not move.
    assert took < PATIENT['command_timeout'] + 1.5
    client.r.check_rests()
    assert client.execute(READY)[1].code in ANSWERS


def operate(words):
    """Call an action from a terminal; return the exit code and what is printed."""
    command = [sys.executable, '-m', 'isotruss_ros.cli.operate', *words.split()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    return done.returncode, done.stdout


def test_an_object_is_picked_up_moved_and_placed(client):
    client.let_go()
    lay = client.place()
    code, said = operate('pick --squeeze 15')
    words = r'pick_object: held at north/\w, squeeze (\S+) N, deviation (\S+) N'
    ((squeeze, deviation),) = re.findall(words, said)
    assert 0.0 < float(deviation) < 0.5 * float(squeeze)
    # Commands that come late on a busy machine close the grip unevenly, and push the object.
    assert (code, 5.0 < float(squeeze) < 25.0) == (0, True)
    status, refused = client.end(client.begin(PICK))
    assert status == GoalStatus.STATUS_ABORTED
    assert 'first place the object' in refused.message
    assert np.hypot(*(client.place() - lay)) < DIAMETER / 4
    goal = np.array([0.6, 0.35])
    status, result = client.execute(MoveObject.Goal(path=path_to(*goal)))
    assert (status, result.code) == (GoalStatus.STATUS_SUCCEEDED, 0), result.message
    # Commands that come late, zeros among them, take it beyond the tolerance of the goal.
    assert np.hypot(*(client.place() - goal)) < 2e-2
    client.r.check_rests()
    held = client.place()
    _, refused = client.execute(PlaceObject.Goal(max_rotation=1e-9))
    assert refused.code == refused.NO_MOTION_FOUND
    assert 'turns the object by' in refused.message
    status, result = client.execute(APART)
    assert (status, result.code) == (GoalStatus.STATUS_SUCCEEDED, 0), result.message
    assert result.displacement < 1e-2
    assert np.hypot(*(client.place() - held)) < 1e-2
    assert result.object_pose.pose.position.x == pytest.approx(client.place()[0], abs=1e-6)
    status, refused = client.end(client.begin(MoveObject.Goal(path=path_to(*CENTER))))
    assert status == GoalStatus.STATUS_ABORTED
    assert refused.code == MoveObject.Result.NOT_HELD
    assert 'not held' in refused.message
    assert operate('place')[0] == 1


@pytest.mark.nightly
def test_the_example_picks_an_object_up_and_places_it(client):
    client.let_go()
    example = Path(__file__).parents[2] / 'examples' / 'ros_pick_and_place.py'
    done = subprocess.run(
        [sys.executable, example], capture_output=True, text=True, timeout=300, check=True
    )
    assert 'pick_object: held at' in done.stdout
    assert 'place_object: the object is free' in done.stdout


@pytest.mark.nightly
def test_a_motion_ends_with_a_pick_and_place_that_is_killed(client):
    r = client.r
    client.until_moving(0.002)
    r.signal('pick_and_place', signal.SIGKILL)
    r.w.until(lambda: 'supervises the goal' in r.w.report('path_follower').message)
    r.check_rests()
