# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""First half of the demonstration: a grasp is planned, reached, and confirmed to hold."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
import os
import time
from typing import Any

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.action import PlanGrasp
from isotruss_msgs.msg import GraspState, PlannedGrasp, StateEstimate
from isotruss_ros.core import Status
from isotruss_ros.core.paths.roller_trajectory import START_TOLERANCE
from isotruss_ros.demo.client import DEADLINE, DemoClient, DemoError
from isotruss_ros.demo.record import PhaseRecord
from isotruss_ros.nodes.conversions.messages import to_pose_message
from isotruss_ros.nodes.conversions.path_messages import read_duration, to_duration
from isotruss_ros.nodes.framework.supervision import describe_absence
from isotruss_ros.nodes.framework.topics import RELIABLE
import numpy as np
from rclpy.action import ActionClient
from rclpy.task import Future
from trajectory_msgs.msg import JointTrajectory

Check = Callable[[], None]

#: Time limit of a search, after which its best grasp is used [s]; a search takes some seconds, and
#: longer on a busy machine.
PLANNING_LIMIT = 120.0
#: Number of conditions of the start of all nodes [-].
START_CONDITIONS = 6
#: Largest standard deviation of a roller offset at which a grasp is planned [m].
MAX_OFFSET_DEVIATION = 1e-3


def slow_down(grasp: PlannedGrasp, factor: float) -> None:
    """
    Multiply all times of the path to a grasp by a factor.

    :param factor: factor on all times of the path [-].
    """
    for point in grasp.path.points:
        point.time_from_start = to_duration(factor * read_duration(point.time_from_start))
    grasp.touch = to_duration(factor * read_duration(grasp.touch))


def find_unknown_offsets(estimates: Sequence[StateEstimate]) -> Iterator[str]:
    """Yield a sentence for each roller offset with more than `MAX_OFFSET_DEVIATION`."""
    if not estimates:
        yield 'no message of state_estimate'
        return
    last = estimates[-1]
    covariance = np.reshape(last.offset_covariance, 2 * [len(last.offsets)])
    deviations = np.sqrt(np.diag(covariance)).tolist()
    for name, deviation in zip(last.roller_names, deviations, strict=True):
        if not deviation <= MAX_OFFSET_DEVIATION:
            yield (
                f'the standard deviation of the offset of roller {name} is {1e3 * deviation:.3g} '
                f'mm; must be at most {1e3 * MAX_OFFSET_DEVIATION:g} mm'
            )


def describe_load() -> str:
    """Return a sentence with the load of the machine of the last minute."""
    load, cores = os.getloadavg()[0], os.cpu_count()
    return f'the machine has a load of {load:.1f} on {cores} processors'


class Gripping:
    """Client of the nodes that plan a grasp and follow the path to it."""

    def __init__(self, client: DemoClient, check: Check) -> None:
        self._client, self._check = client, check
        self._planner = ActionClient(client, PlanGrasp, 'plan_grasp')
        self._trajectories = client.create_publisher(
            JointTrajectory, 'joint_trajectory_controller/joint_trajectory', RELIABLE
        )

    def wait_until_ready(
        self, progress: Callable[[float], None], estimated: bool = False
    ) -> PhaseRecord:
        """Wait until all nodes publish and the robot is at rest."""
        client = self._client
        record = client.begin('start')

        def find_unmet() -> list[str]:
            unmet = list(find_missing())
            progress(max(0.0, 1.0 - len(unmet) / START_CONDITIONS))
            return unmet

        def find_missing() -> Iterator[str]:
            yield from client.find_motion()
            if client.measured is None:
                yield 'no message of object_pose'
            if client.last_grasp() is None:
                yield 'no message of grasp/state'
            if estimated:
                yield from find_unknown_offsets(record.estimates)
            if not self._planner.server_is_ready():
                yield describe_absence('action', 'plan_grasp', 'grasp_planner')
            if not self._trajectories.get_subscription_count():
                yield f'no node subscribes to {self._trajectories.topic_name}'

        client.wait(find_unmet, self._check, 'start of all nodes')
        return record

    def plan(
        self, goal: PlanGrasp.Goal, progress: Callable[[float], None]
    ) -> tuple[PlannedGrasp, PlanGrasp.Result]:
        """
        Request a grasp of the object at its measured pose.

        :return: best grasp, and the whole result of the planner.
        """
        pose = self._client.measured
        goal.object_pose = PoseStamped(pose=to_pose_message(pose))
        goal.object_pose.header.frame_id = self._client.frame_id
        goal.time_limit = PLANNING_LIMIT
        result = self._search(goal, progress)
        end = time.monotonic() + DEADLINE
        # The planner has not discovered the joint states or the state estimates yet.
        while self._planned_blindly(result) and time.monotonic() < end:
            result = self._search(goal, progress)
        if result.code != PlanGrasp.Result.FOUND:
            raise DemoError(f'no grasp was found: {result.message}; {describe_load()}')
        progress(1.0)
        return result.grasps[0], result

    def _planned_blindly(self, result: PlanGrasp.Result) -> bool:
        """Return whether the planned path does not start at the measured roller positions."""
        if result.code != PlanGrasp.Result.FOUND:
            return result.code == PlanGrasp.Result.NO_JOINT_STATES
        begin = np.array(result.grasps[0].path.points[0].positions)
        return bool(np.abs(begin - self._client.rollers).max() > START_TOLERANCE)

    def _search(self, goal: PlanGrasp.Goal, progress: Callable[[float], None]) -> PlanGrasp.Result:
        """Send a goal to the planner, and return its result."""
        searched = ['the search has not reported its progress']

        def note(message: Any) -> None:
            feedback = message.feedback
            progress(min(0.99, feedback.progress))
            searched[0] = (
                f'the search is at {100.0 * feedback.progress:.0f} % after '
                f'{feedback.evaluations} evaluations, with {feedback.found} grasps'
            )

        sent = self._planner.send_goal_async(goal, note)
        handle = self._answer(sent, 'an answer of the planner', DEADLINE, searched)
        if not handle.accepted:
            raise DemoError(
                'grasp_planner rejected the goal: it must be active, without another goal'
            )
        future = handle.get_result_async()
        deadline = goal.time_limit + DEADLINE
        return self._answer(future, 'a planned grasp', deadline, searched).result

    def approach(
        self, grasp: PlannedGrasp, progress: Callable[[float], None]
    ) -> tuple[PhaseRecord, PhaseRecord]:
        """
        Follow the path to a grasp, and wait until the analysis reports the object as held.

        :return: record of the motion until the members touch the object, and record of the motion
            after that.
        """
        client = self._client
        record = client.begin('approach')
        self._trajectories.publish(grasp.path)
        end = np.array(grasp.path.points[-1].positions)
        travel = max(float(np.abs(end - client.rollers).max()), START_TOLERANCE)

        def find_unmet() -> Iterator[str]:
            left = float(np.abs(end - client.rollers).max())
            progress(1.0 - min(1.0, left / travel))
            if Status.ARRIVED not in record.statuses:
                yield f'manipulation has not reported ARRIVED; a roller is {left:.3g} m away'
            yield from client.find_motion()

        deadline = 3.0 * read_duration(grasp.path.points[-1].time_from_start) + DEADLINE
        client.wait(find_unmet, self._check, 'arrival at the grasp', deadline)
        count = len(record.grasps)

        def find_missing_analysis() -> Iterator[str]:
            # This analysis was computed after the robot had come to rest.
            if len(record.grasps) <= count + 1:
                yield f'{len(record.grasps) - count} messages of grasp/state; must be 2'

        client.wait(find_missing_analysis, self._check, 'an analysis at rest')
        progress(1.0)
        if record.squeezes:
            held, why = record.squeezes[-1] > 0.0, 'by its forces'
        else:
            state = client.last_grasp()
            held = state.held == GraspState.HELD_YES
            why = state.message or state.hold_message
        if not held:
            raise DemoError(f'the object is not held: {why}')
        touch = next(p for p in grasp.path.points if p.time_from_start == grasp.touch)
        return record.split('grip', np.array(touch.positions))

    def _answer(self, future: Future, what: str, deadline: float, searched: Sequence[str]) -> Any:
        self._client.wait(
            lambda: [] if future.done() else [*searched, describe_load()],
            self._check,
            what,
            deadline,
            of_manipulation=False,
        )
        return future.result()
