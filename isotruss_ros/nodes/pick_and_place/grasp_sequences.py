# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sequences of actions that pick, place and move an object, with their stages and progress."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
import math
import threading
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
from isotruss_msgs.msg import GraspState
from isotruss_ros.core import IsotrussError, Pose, Robot
from isotruss_ros.core.estimation.state_estimate import MAX_DEVIATIONS
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.inputs import find_fresh, require_fresh, StampedInput
from isotruss_ros.core.model.pose import pose_difference
from isotruss_ros.core.paths.path_tracking import RETURN_SETTINGS, RETURN_SPEED, RETURN_TURN_RATE
from isotruss_ros.core.planning.grasp_plan import path_times
from isotruss_ros.core.planning.plan_path import PathPlan, search_path
from isotruss_ros.core.planning.release import plan_release, Release
from isotruss_ros.core.planning.violations import export_violation, violation_in_words
from isotruss_ros.core.servo.decision import describe_squeeze
from isotruss_ros.nodes.conversions.messages import (
    check_frame,
    make_header,
    MessageError,
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
from isotruss_ros.nodes.framework.supervision import MIN_FEEDBACK_TIMEOUT, TOPIC
from isotruss_ros.nodes.framework.topics import LATCHED
from isotruss_ros.nodes.pick_and_place.action_steps import (
    ActionStep,
    set_parameters,
    StepError,
    StepOutcome,
    Steps,
)
from isotruss_ros.nodes.pick_and_place.object_watch import AveragePose, ObjectWatch
from nav_msgs.msg import Path
import numpy as np
from rcl_interfaces.srv import SetParameters

#: Default of the largest predicted rotation of the object at its release [rad].
MAX_ROTATION = math.radians(5.0)
#: Largest displacement of the object by the closing grip that is not corrected [m].
RETURN_TOLERANCE = 1e-3
#: Longest accepted time without feedback of the planner [s]; the time is shorter for nodes that
#: move the robot.
PLANNER_TIMEOUT = 5.0
PICK, PLACE, MOVE = PickObject.Feedback, PlaceObject.Feedback, MoveObject.Feedback


class GraspSequences:
    """
    Sequences of actions that pick, place and move an object.

    The actions are those of `grasp_planner`, `manipulation` and `path_follower`.
    """

    def __init__(self, node: ManagedNode, robot: Robot, watch: ObjectWatch) -> None:
        self._node, self._robot, self._watch = node, robot, watch
        self._inputs = watch.inputs
        self.stage = 0  #: current stage, a constant of the action's feedback
        self._described = common.read_described(node.values)
        self._obstacles = common.read_resting_obstacles(node.values)
        # Before the actions: a server that has discovered their clients has discovered the
        # publisher.
        alive = node.advertise(GoalInfo, TOPIC).publish
        self._planner = ActionStep(node, PlanGrasp, 'plan_grasp', alive, lambda: PLANNER_TIMEOUT)
        self._trajectories, self._object = (
            ActionStep(node, kind, name, alive, lambda: max(watch.timeout, MIN_FEEDBACK_TIMEOUT))
            for kind, name in (
                (FollowRollerTrajectory, 'follow_roller_trajectory'),
                (FollowObjectPath, 'follow_object_path'),
            )
        )
        self._parameters = node.create_client(SetParameters, 'manipulation/set_parameters')
        self._paths = node.advertise(Path, 'planned_path', LATCHED)
        self._thread = ThreadPoolExecutor(max_workers=1)

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
        measured = self._inputs.pose
        if not isinstance(measured, StampedInput):
            return None
        return self._to_pose_stamped(measured.value, measured.time)

    def _to_pose_stamped(self, pose: Pose, time: float | None = None) -> PoseStamped:
        """Return a pose as a message, with a time [s]; None: the current time."""
        header = make_header(self._node.now() if time is None else time, self._robot.frame)
        return PoseStamped(header=header, pose=to_pose_message(pose))

    def distance_left(self, path: Path) -> tuple[float, float]:
        """
        Return the distance [m] and angle [rad] between the object and the last pose of a path.

        :return: distance and angle; NaN if a pose is unknown.
        """
        try:
            timeout, measured = self._watch.timeout, self._inputs.pose
            (here,) = require_fresh(self._node.now(), timeout, object_pose=measured)
            end = read_pose('pose', path.poses[-1].pose)
        except (IsotrussError, IndexError):
            return math.nan, math.nan
        x, y, turned = pose_difference(end, here.value).tolist()
        return math.hypot(x, y), abs(turned)

    def pick(self, goal: PickObject.Goal) -> Steps:
        """
        Plan a grasp, approach the object, close the grip, and confirm that the object is held.

        An object that the closing grip has displaced is moved back.
        """
        self.stage = PICK.PLANNING
        yield from self._watch.await_inputs()
        self._watch.require_free()
        first = yield from self._watch.average_poses()
        lay = self._to_pose_stamped(first.pose)
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
        state = yield from self._watch.confirm(True)
        note = yield from self.bring_back(first)
        if note:
            state = yield from self._watch.confirm(True)
        where = grasp.module or ', '.join(grasp.members)
        return PickObject.Result(
            message=f'held at {where}, {_squeeze_in_words(state)}{note}',
            module=grasp.module,
            members=state.grasping_members,
            squeeze=float(np.mean(state.squeeze)),
            squeeze_deviation=state.squeeze_deviation,
            squeeze_assumed=state.squeeze_assumed,
            slip_margin=state.slip_margin,
        )

    def place(self, goal: PlaceObject.Goal) -> Steps:
        """Decrease the squeeze, open the grip, retreat, and confirm that the object is free."""
        self.stage = PLACE.PLANNING
        if not goal.max_rotation >= 0.0:
            raise MessageError(
                f'max_rotation {goal.max_rotation} rad: must not be negative; 0 for the default'
            )
        state = yield from self._watch.await_held(StepOutcome.NOT_READY)
        pose = self._inputs.pose.value  # type: ignore[union-attr]
        config = self._inputs.configuration(self._node.now())
        body = common.make_body(self._node.values, self._described).moved_to(pose)
        record = find_fresh(self._node.now(), self._watch.timeout, self._inputs.held_grip)
        most = goal.max_rotation or MAX_ROTATION
        planned: Future[Release] = self._thread.submit(
            plan_release,
            config,
            body,
            state.grasping_members,
            goal.clearance,
            record,
            most,
            self._obstacles,
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
        yield from self._watch.confirm(False)
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
        """Move the held object along a path."""
        self.stage = MOVE.MOVING
        yield from self._watch.await_held(StepOutcome.NOT_HELD)
        path = goal.path
        if self._node.values.plan and len(path.poses) == 1:
            path = yield from self._plan(goal)
        wanted = FollowObjectPath.Goal(path=path, speed=goal.speed, turn_rate=goal.turn_rate)
        followed = yield from self._carry(wanted)
        codes = FollowObjectPath.Result
        if followed.code != codes.REACHED:
            bad = followed.code == codes.BAD_GOAL
            raise StepError(StepOutcome.BAD_GOAL if bad else StepOutcome.STOPPED, followed.message)
        return MoveObject.Result(message=followed.message)

    def _plan(self, goal: MoveObject.Goal) -> Steps:
        """Search for a path to the only pose of a goal, publish and return it."""
        self.stage, used = MOVE.PLANNING, 0.0
        now, (stamped,) = self._node.now(), goal.path.poses
        check_frame('path', goal.path.header, self._robot.frame)
        check_frame('pose', stamped.header, self._robot.frame)
        end, here = read_pose('pose', stamped.pose), self._inputs.pose.value
        config = self._inputs.configuration(now)
        body = common.make_body(self._node.values, self._described).moved_to(here)
        record = find_fresh(now, self._watch.timeout, self._inputs.held_grip)
        obstacles = (*self._obstacles, *self._inputs.present_obstacles(now))
        stop = threading.Event()

        def note(share: float) -> None:
            nonlocal used
            used = share

        def search() -> PathPlan:
            friction = body.friction_or(None)
            held = attach_grip(config, body) if record is None else record.restore(config, body)
            return search_path(
                held,
                friction,
                end,
                obstacles,
                on_progress=note,
                should_stop=stop.is_set,
                speed=goal.speed,
                turn_rate=goal.turn_rate,
            )

        planned = self._thread.submit(search)
        try:
            while not planned.done():
                yield used
        finally:
            stop.set()
        plan = planned.result()
        if plan.why:
            raise StepError(StepOutcome.STOPPED, plan.why)
        poses = [self._to_pose_stamped(Pose(*pose)) for pose in plan.poses.tolist()]
        path = Path(header=poses[0].header, poses=poses)
        self._paths.publish(path)
        self.stage = MOVE.MOVING
        return path

    def _carry(self, goal: FollowObjectPath.Goal) -> Steps:
        """Move the held object along a path, and return the result; end at a loss."""
        self._watch.begin_motion()
        return (yield from self._object.run(goal, find_fault=self._watch.find_loss))

    def bring_back(self, first: AveragePose) -> Steps:
        """Move a displaced object back to its initial pose; return a sentence with the result."""
        here = yield from self._watch.average_poses()
        moved, deviation = first.distance(here)
        if moved <= max(RETURN_TOLERANCE, 2.0 * deviation):
            return ''
        ends = [self._to_pose_stamped(mean.pose) for mean in (here, first)]
        goal = FollowObjectPath.Goal(
            path=Path(header=ends[0].header, poses=ends),
            speed=RETURN_SPEED,
            turn_rate=RETURN_TURN_RATE,
            # Each reading on the path has the noise of one reading.
            position_tolerance=RETURN_SETTINGS.position_tolerance + MAX_DEVIATIONS * here.noise,
        )
        why = ''
        try:
            followed = yield from self._carry(goal)
            if followed.code != FollowObjectPath.Result.REACHED:
                why = f' ({followed.message})'
        except StepError as error:
            # The object is held: the next motion can start at its current pose.
            why = f' ({error})'
        left, deviation = first.distance((yield from self._watch.average_poses()))
        return (
            f'; closing displaced the object by {1e3 * moved:.3g} mm, corrected to '
            f'{1e3 * left:.3g} mm, deviation {1e3 * deviation:.2g} mm{why}'
        )

    def _drive(self, trajectory: Any, change: float, before: int, after: int) -> Steps:
        """Move the rollers; the stage is `before` until `change` [s], and then `after`."""
        end = read_duration(trajectory.points[-1].time_from_start)

        def progress(feedback: Any) -> float:
            time = read_duration(feedback.desired.time_from_start)
            is_before = time < change + 1e-9  # times in messages are whole nanoseconds
            self.stage = before if is_before else after
            begin, over = (0.0, change) if is_before else (change, end)
            return min(1.0, (time - begin) / max(over - begin, 1e-9))

        self.stage = before
        goal = FollowRollerTrajectory.Goal(trajectory=trajectory)
        result = yield from self._trajectories.run(goal, progress)
        if result.error_code != result.SUCCESSFUL:
            raise StepError(StepOutcome.STOPPED, result.error_string)


def _squeeze_in_words(state: GraspState) -> str:
    """Return a text with the squeeze and its deviation, which is NaN if unknown."""
    squeeze, deviation = float(np.mean(state.squeeze)), state.squeeze_deviation
    if math.isnan(deviation):
        return f'squeeze {squeeze:.1f} N, deviation unknown: manipulation has published no grip'
    return describe_squeeze(squeeze, deviation, state.squeeze_assumed)


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
