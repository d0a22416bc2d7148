# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether the object is held: yes, no or unknown, in messages and for motions of the object."""

import math
from types import SimpleNamespace

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.action import MoveObject
from isotruss_msgs.msg import GraspState, ManipulationStatus
from isotruss_ros.core import Pose
from isotruss_ros.core.inputs import LatestInputs, StampedInput
from isotruss_ros.nodes.conversions.messages import make_header, to_pose_message
from isotruss_ros.nodes.grasp_analysis import GraspAnalysisNode
from isotruss_ros.nodes.pick_and_place import action_steps
from isotruss_ros.nodes.pick_and_place.node import PickAndPlace
from isotruss_ros.nodes.pick_and_place.object_watch import CONFIRMATION_TIMEOUT, ObjectWatch
from manual_actions import MotionClient, replace_clients
from manual_world import world
from nav_msgs.msg import Path
from probe import CENTER, maker
import pytest

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
    # The probe has the object at an angle of 0.3 rad.
    left = mover.result.position_error, mover.result.angle_error
    assert left == pytest.approx((0.05, 0.1))


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
