# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sequences of actions that pick, place and move an object, with their stages and progress."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
import math
import time
from typing import Any

from action_msgs.msg import GoalInfo
from geometry_msgs.msg import PoseStamped
from isotruss_msgs.action import (
    FollowObjectPath,
    FollowRollerTrajectory,
    MoveObject,
    PickObject,
    PlaceObject,
    PlanGrasp,
)
from isotruss_ros.core import IsotrussError, Robot
from isotruss_ros.core.inputs import find_fresh, Input, InputError, require_fresh, StampedInput
from isotruss_ros.core.model.pose import pose_difference
from isotruss_ros.core.paths.path_tracking import RETURN_SETTINGS, RETURN_SPEED, RETURN_TURN_RATE
from isotruss_ros.core.planning.describe_plan import path_times
from isotruss_ros.core.planning.release import plan_release, Release
from isotruss_ros.core.planning.violations import export_violation, violation_in_words
from isotruss_ros.nodes.conversions.messages import (
    make_header,
    MessageError,
    read_held,
    read_pose,
    to_pose_message,
)
from isotruss_ros.nodes.conversions.object_messages import to_object_message
from isotruss_ros.nodes.conversions.path_messages import (
    read_duration,
    to_trajectory_message,
)
from isotruss_ros.nodes.framework import common_parameters as common
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.sensors import Inputs
from isotruss_ros.nodes.framework.supervision import MIN_FEEDBACK_TIMEOUT, TOPIC
from isotruss_ros.nodes.pick_and_place.action_steps import (
    ActionStep,
    set_parameters,
    StepError,
    StepOutcome,
    Steps,
)
from nav_msgs.msg import Path
import numpy as np
from rcl_interfaces.srv import SetParameters

#: Default of the largest predicted rotation of the object at its release [rad].
MAX_ROTATION = math.radians(5.0)
#: Largest displacement of the object by the closing grip that is not corrected [m].
RETURN_TOLERANCE = 1e-3
#: Longest wait until the grasp analysis confirms that the object is held or is free [s].
CONFIRMATION_TIMEOUT = 5.0
#: Longest wait for missing or stale inputs before a motion [s].
INPUT_TIMEOUT = 1.0
#: Longest accepted time without feedback of the planner [s]; the time is shorter for nodes that
#: move the robot.
PLANNER_TIMEOUT = 5.0
PICK, PLACE, MOVE = PickObject.Feedback, PlaceObject.Feedback, MoveObject.Feedback


class GraspSequences:
    """
    Sequences of actions that pick, place and move an object.

    The actions are those of `grasp_planner`, `manipulation` and `path_follower`.

    :param node: node of the action clients, which exist as long as the node.
    :param robot: the robot.
    :param inputs: latest inputs of the node.
    """

    def __init__(self, node: ManagedNode, robot: Robot, inputs: Inputs) -> None:
        self._node, self._robot, self._inputs = node, robot, inputs
        self.stage = 0  #: current stage, a constant of the action's feedback
        self._held_at = 0.0  # last time at which the moving object was known to be held [s]
        self._described = common.read_described(node.values)
        # Before the actions: a server that has discovered their clients has discovered the
        # publisher.
        alive = node.advertise(GoalInfo, TOPIC).publish
        self._planner = ActionStep(node, PlanGrasp, 'plan_grasp', alive, lambda: PLANNER_TIMEOUT)
        self._trajectories, self._object = (
            ActionStep(node, kind, name, alive, lambda: max(self._timeout, MIN_FEEDBACK_TIMEOUT))
            for kind, name in (
                (FollowRollerTrajectory, 'follow_roller_trajectory'),
                (FollowObjectPath, 'follow_object_path'),
            )
        )
        self._parameters = node.create_client(SetParameters, 'manipulation/set_parameters')
        self._thread = ThreadPoolExecutor(max_workers=1)

    @property
    def _timeout(self) -> float:
        """Return the largest admissible age of inputs [s]."""
        return self._node.values.command_timeout

    def close(self) -> None:
        """End the thread in which releases are planned."""
        self._thread.shutdown(wait=False, cancel_futures=True)

    def _to_search_goal(self, goal: PickObject.Goal, lay: PoseStamped) -> PlanGrasp.Goal:
        """Return the goal of the grasp search for picking the object at a pose."""
        values, described = self._node.values, self._described
        wanted = PlanGrasp.Goal(
            object_pose=lay,
            friction=values.friction,
            module=goal.module,
            members=goal.members,
            squeeze=goal.squeeze,
            min_slip_margin=goal.min_slip_margin,
            time_limit=goal.time_limit,
            count=1,
        )
        if described is None:
            wanted.object_diameter = values.object_diameter
        else:
            wanted.object = to_object_message(described)
        return wanted

    def measured_pose(self) -> PoseStamped | None:
        """Return the last measured pose of the object as a message; None before the first pose."""
        if not isinstance(self._inputs.pose, StampedInput):
            return None
        header = make_header(self._inputs.pose.time, self._robot.frame)
        return PoseStamped(header=header, pose=to_pose_message(self._inputs.pose.value))

    def distance_left(self, path: Path) -> tuple[float, float]:
        """
        Return the distance [m] and angle [rad] between the object and the last pose of a path.

        :param path: path of a goal.
        :return: distance and angle; NaN if a pose is unknown.
        """
        try:
            return self._measure_error(path.poses[-1])
        except (IsotrussError, IndexError):
            return math.nan, math.nan

    def _measure_error(self, end: PoseStamped) -> tuple[float, float]:
        """Return the distance [m] and angle [rad] between the object and a pose."""
        (here,) = require_fresh(self._node.now(), self._timeout, object_pose=self._inputs.pose)
        x, y, turned = pose_difference(read_pose('pose', end.pose), here.value)
        return math.hypot(x, y), abs(turned)

    def pick(self, goal: PickObject.Goal) -> Steps:
        """
        Plan a grasp, approach the object, close the grip, and confirm that the object is held.

        An object that the closing grip has displaced is moved back.

        :param goal: goal of the action.
        :raises IsotrussError: the object is not held.
        """
        self.stage = PICK.PLANNING
        yield from self._await_inputs()
        self._require_free()
        lay = self.measured_pose()
        plan = yield from self._planner.run(self._to_search_goal(goal, lay))
        if plan.code != PlanGrasp.Result.FOUND:
            raise _plan_error(plan)
        (grasp,) = plan.grasps
        settings = {'mode': 'object', 'squeeze_force': grasp.squeeze, 'grip': ['']}
        if grasp.module:
            settings['grip_module'] = grasp.module
        else:
            settings['grip'] = list(grasp.members)
        yield from set_parameters(self._parameters, settings)
        touch = read_duration(grasp.touch)
        yield from self._drive(grasp.path, touch, PICK.APPROACHING, PICK.CLOSING)
        self.stage = PICK.CONFIRMING
        state = yield from self._confirm(True)
        note = yield from self._bring_back(lay)
        if note:
            state = yield from self._confirm(True)
        squeeze = float(np.mean(state.squeeze))
        where = grasp.module or ', '.join(grasp.members)
        return PickObject.Result(
            message=f'held at {where} by {squeeze:.3g} N{note}',
            module=grasp.module,
            members=state.grasping_members,
            squeeze=squeeze,
            slip_margin=state.slip_margin,
        )

    def _require_free(self) -> None:
        """Raise StepError if the object is already held."""
        # The analysis may arrive only after the pick.
        found = find_fresh(self._node.now(), self._timeout, self._inputs.grasp)
        if found is not None and read_held(found):
            members = ', '.join(found.grasping_members)
            raise StepError(
                StepOutcome.BAD_GOAL,
                f'the object is already held by {members}: first place the object',
            )

    def place(self, goal: PlaceObject.Goal) -> Steps:
        """
        Decrease the squeeze, open the grip, retreat, and confirm that the object is free.

        :param goal: goal of the action.
        :raises IsotrussError: the object is not free.
        """
        self.stage = PLACE.PLANNING
        if not goal.max_rotation >= 0.0:
            raise MessageError(
                f'max_rotation {goal.max_rotation} rad: must not be negative; 0 for the default'
            )
        state = yield from self._await_held(StepOutcome.NOT_READY)
        pose = self._inputs.pose.value  # type: ignore[union-attr]
        config = self._inputs.configuration(self._node.now())
        body = common.make_body(self._node.values, self._described).moved_to(pose)
        record = find_fresh(self._node.now(), self._timeout, self._inputs.held_grip)
        most = goal.max_rotation or MAX_ROTATION
        planned: Future[Release] = self._thread.submit(
            plan_release, config, body, state.grasping_members, goal.clearance, record, most
        )
        while not planned.done():
            yield 0.0
        release = planned.result()
        if release.violation is not None:
            raise StepError(
                StepOutcome.NO_MOTION_FOUND,
                f'the grip cannot open: {violation_in_words(release.violation)}',
                **export_violation(release.violation),
            )
        near = np.arange(len(release.path) - 1) <= release.apart
        times = path_times(release.path, self._robot.description, near)
        trajectory = to_trajectory_message(self._robot, release.path.tolist(), times.tolist())
        apart = float(times[release.apart])
        yield from self._drive(trajectory, apart, PLACE.OPENING, PLACE.BACKING_OFF)
        self.stage = PLACE.CONFIRMING
        yield from self._confirm(False)
        now = self._inputs.pose.value  # type: ignore[union-attr]
        x, y, turned = pose_difference(now, pose).tolist()
        moved = math.hypot(x, y)
        way = f'{1e3 * moved:.3g} mm and {math.degrees(turned):+.2g}°'
        return PlaceObject.Result(
            message=f'the object is free; displacement since the goal: {way}',
            displacement=moved,
            rotation=turned,
        )

    def move(self, goal: MoveObject.Goal) -> Steps:
        """
        Move the held object along a path.

        :param goal: goal of the action.
        :raises IsotrussError: the object is not at the end of the path.
        """
        self.stage = MOVE.MOVING
        yield from self._await_held(StepOutcome.NOT_HELD)
        wanted = FollowObjectPath.Goal(path=goal.path, speed=goal.speed, turn_rate=goal.turn_rate)
        followed = yield from self._carry(wanted)
        codes = FollowObjectPath.Result
        if followed.code != codes.REACHED:
            bad = followed.code == codes.BAD_GOAL
            raise StepError(StepOutcome.BAD_GOAL if bad else StepOutcome.STOPPED, followed.message)
        return MoveObject.Result(message=followed.message)

    def _carry(self, goal: FollowObjectPath.Goal) -> Steps:
        """Move the held object along a path, and return the result; end at a loss."""
        self._held_at = self._node.now()
        return (yield from self._object.run(goal, find_fault=self._find_loss))

    def _bring_back(self, lay: PoseStamped) -> Steps:
        """Move a displaced object back to its initial pose; return a sentence with the result."""
        moved, _ = self._measure_error(lay)
        if moved <= RETURN_TOLERANCE:
            return ''
        goal = FollowObjectPath.Goal(
            path=Path(header=lay.header, poses=[lay]),
            speed=RETURN_SPEED,
            turn_rate=RETURN_TURN_RATE,
            position_tolerance=RETURN_SETTINGS.position_tolerance,
        )
        why = ''
        try:
            followed = yield from self._carry(goal)
            if followed.code != FollowObjectPath.Result.REACHED:
                why = f' ({followed.message})'
        except StepError as error:
            # The object is held: the next motion can start at its current pose.
            why = f' ({error})'
        left, _ = self._measure_error(lay)
        return (
            f'; closing displaced the object by {1e3 * moved:.3g} mm, corrected to '
            f'{1e3 * left:.3g} mm{why}'
        )

    def _drive(self, trajectory: Any, change: float, before: int, after: int) -> Steps:
        """Move the rollers; the stage is `before` until `change` [s], and then `after`."""
        end = read_duration(trajectory.points[-1].time_from_start)

        def progress(feedback: Any) -> float:
            time = read_duration(feedback.desired.time_from_start)
            self.stage = before if time < change else after
            begin, over = (0.0, change) if time < change else (change, end)
            return min(1.0, (time - begin) / max(over - begin, 1e-9))

        self.stage = before
        goal = FollowRollerTrajectory.Goal(trajectory=trajectory)
        result = yield from self._trajectories.run(goal, progress)
        if result.error_code != result.SUCCESSFUL:
            raise StepError(StepOutcome.STOPPED, result.error_string)

    def _confirm(self, held: bool) -> Steps:
        """Wait until an analysis of the robot at rest reports the object as held, or as free."""
        arrived = self._node.now()
        while True:
            now, analysed = self._node.now(), -np.inf
            if isinstance(self._inputs.grasp, StampedInput):
                state, analysed = self._inputs.grasp.value, self._inputs.grasp.time
                if read_held(state) is held and analysed > arrived:
                    return state
            # The wait is timed by the stamps of the analyses, which are late on a busy machine, or
            # by the clock if no analyses arrive.
            waited = max(analysed, now - self._timeout) - arrived
            if waited > CONFIRMATION_TIMEOUT:
                has_answer = analysed > arrived and read_held(state) is not None
                outcome = StepOutcome.NOT_HELD if has_answer else StepOutcome.NOT_READY
                raise StepError(outcome, self._describe_grasp(arrived))
            yield min(1.0, max(0.0, waited / CONFIRMATION_TIMEOUT))

    def _await_inputs(self, **inputs: Callable[[], Input]) -> Steps:
        """Wait for fresh roller positions, object pose and other inputs, with a timeout."""
        begun = time.monotonic()
        while True:
            try:
                return require_fresh(
                    self._node.now(),
                    self._timeout,
                    joint_states=self._inputs.rollers,
                    object_pose=self._inputs.pose,
                    **{name: find() for name, find in inputs.items()},  # type: ignore[arg-type]
                )
            except InputError:
                if time.monotonic() - begun > INPUT_TIMEOUT:
                    raise
            yield 0.0

    def _await_held(self, otherwise: StepOutcome) -> Steps:
        """Wait until it is known whether the object is held; return the analysis if it is."""
        begun = time.monotonic()
        while True:
            *_, grasp = yield from self._await_inputs(grasp_state=lambda: self._inputs.grasp)
            if self.is_held is False:
                raise StepError(otherwise, self._describe_grasp())
            if read_held(grasp.value):
                return grasp.value
            if time.monotonic() - begun > INPUT_TIMEOUT:
                raise StepError(StepOutcome.NOT_READY, self._describe_grasp())
            yield 0.0

    @property
    def is_held(self) -> bool | None:
        """
        Return whether the object is held; None if neither analysis nor control loop know.

        One of them suffices, since each of them may be late; a loss counts before a hold.
        """
        reported = [read_held(report) for report in self._fresh_reports()]
        return False if False in reported else True if True in reported else None

    def _fresh_reports(self) -> list[Any]:
        """Return the last messages of `grasp_analysis` and `manipulation` that are not stale."""
        now, inputs = self._node.now(), self._inputs
        reports = (
            find_fresh(now, self._timeout, it) for it in (inputs.grasp, inputs.servo_feedback)
        )
        return [report for report in reports if report is not None]

    def _find_loss(self) -> StepError | None:
        """Return an error if the object is lost, or if its hold is unknown for the timeout."""
        now, held = self._node.now(), self.is_held
        if held is False:
            return StepError(StepOutcome.NOT_HELD, self._describe_grasp())
        if held or now < self._held_at:
            self._held_at = now
        if now - self._held_at <= self._timeout:
            return None
        return StepError(StepOutcome.STOPPED, self._describe_grasp())

    def _describe_grasp(self, since: float = -np.inf) -> str:
        """Return a text about the hold; with a time [s], by an analysis that is later."""
        lost = [report for report in self._fresh_reports() if read_held(report) is False]
        given = self._inputs.grasp
        if lost:
            why = lost[0].message or getattr(lost[0], 'hold_message', '')
            return f'the object is not held: {why}'
        unknown = 'it is unknown whether the object is held'
        if not isinstance(given, StampedInput):
            return f'{unknown}: no analysis of the grasp was received'
        if given.time <= since:
            return f'{unknown}: no analysis of the grasp was received since the rollers arrived'
        if self.is_held:
            return f'the object is held, with a slip margin of {given.value.slip_margin:.3g} N'
        why = given.value.message or 'no result'
        return f'{unknown}: {why}; the last analysis is {self._node.now() - given.time:.2f} s old'


def _plan_error(plan: PlanGrasp.Result) -> StepError:
    codes = {
        plan.BAD_GOAL: StepOutcome.BAD_GOAL,
        plan.NO_JOINT_STATES: StepOutcome.NOT_READY,
        plan.FAILED: StepOutcome.STOPPED,
    }
    return StepError(
        codes.get(plan.code, StepOutcome.NO_MOTION_FOUND),
        plan.message,
        violated_requirement=plan.violated_requirement,
        violation_value=plan.violation_value,
        violation_bound=plan.violation_bound,
    )
