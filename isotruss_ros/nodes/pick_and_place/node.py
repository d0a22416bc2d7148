# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node `pick_and_place`, which picks, moves and places an object by actions of other nodes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from isotruss_msgs.action import MoveObject, PickObject, PlaceObject
from isotruss_msgs.msg import ManipulationStatus
from isotruss_ros.core import IsotrussError
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.inputs import InputError
from isotruss_ros.nodes.conversions.messages import HELD_VALUES, MessageError
from isotruss_ros.nodes.framework import common_parameters as common
from isotruss_ros.nodes.framework.gate import Topic
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.parameters import Spec
from isotruss_ros.nodes.framework.sensors import Inputs
from isotruss_ros.nodes.framework.single_goal import BusyError, SingleGoal
from isotruss_ros.nodes.pick_and_place.action_steps import (
    CancelledError,
    StepError,
    StepOutcome,
    Steps,
    TICK_PERIOD,
)
from isotruss_ros.nodes.pick_and_place.grasp_sequences import GraspSequences
from isotruss_ros.nodes.pick_and_place.object_watch import ObjectWatch

SPECS = (
    *common.OBJECT_SPECS,
    common.OBSTACLES,
    common.OBSTACLE_TIMEOUT,
    common.COMMAND_TIMEOUT,
    Spec(
        'plan',
        False,
        'Whether move_object with one pose searches for a path around obstacles and limits of the '
        'robot; if false, the path is straight',
    ),
)


class PickAndPlace(ManagedNode):
    """Node that executes one sequence at a time, and refuses other goals meanwhile."""

    node_name = 'pick_and_place'
    specs = SPECS
    awaited = ('pick_object', 'move_object', 'place_object')
    idle = 'no goal'
    _sequences: GraspSequences | None = None
    _course: Steps | None = None
    _cancelling = False
    _began = 0.0

    def configure(self) -> None:
        """Create clients and subscriptions, and offer the actions."""
        self.inputs = Inputs(self, self.robot)
        self.inputs.keep('rollers', 'estimate', 'pose', 'held_grip', 'grasp', 'obstacles')
        statuses = Topic(
            ManipulationStatus, 'manipulation/status', lambda status: status, 'status'
        )
        self.inputs.keep_topic('servo_feedback', statuses)
        watch = self._watch = ObjectWatch(self, self.inputs)
        sequences = self._sequences = GraspSequences(self, self.robot, watch)
        # Exists while the node is inactive as well, so that a goal that ends then gets its result.
        self._actions = [
            self._offer(PickObject, 'pick_object', sequences.pick),
            self._offer(PlaceObject, 'place_object', sequences.place),
            self._offer(MoveObject, 'move_object', sequences.move),
        ]

    def activate(self) -> None:
        """Accept goals of the three actions from now on."""
        self.create_steady_timer(TICK_PERIOD, self._tick)

    def deactivate(self) -> None:
        """End the active goal, and cancel the actions of its steps."""
        if self._course is not None:
            self._course.close()
            self._end(StepError(StepOutcome.STOPPED, 'the node was deactivated'))

    def cleanup(self) -> None:
        """Release the clients of the other nodes."""
        if self._sequences is not None:
            self._sequences.close()

    def details(self) -> dict[str, object]:
        """Return the active goal and its stage for the diagnostics."""
        return {'executing': 'nothing' if self._goal is None else self._goal.kind.__name__}

    @property
    def _goal(self) -> SingleGoal | None:
        return next((action for action in self._actions if action.active), None)

    def _offer(self, kind: Any, name: str, sequence: Callable[[Any], Steps]) -> SingleGoal:
        """Offer an action whose goals are executed, and checked, by a sequence."""

        def read(goal: Any) -> Any:
            if (running := self._goal) is not None:
                raise BusyError(
                    f'{running.kind.__name__} has been executed for '
                    f'{self.now() - self._began:.0f} s: cancel it, or wait for its end'
                )
            return goal

        def refuse(error: IsotrussError) -> Any:
            return kind.Result(code=StepOutcome.NOT_READY, message=str(error))

        def begin(goal: Any) -> None:
            self._course, self._cancelling = sequence(goal), False
            self._began = self.now()
            self.diagnostics.set_status(name)

        return SingleGoal(self, kind, name, read, refuse, begin, self._request_cancel)

    def _request_cancel(self) -> None:
        self._cancelling = True

    def _tick(self) -> None:
        """Resume the sequence; if it ends, end the goal."""
        self.inputs.settle()
        self.inputs.track()
        course = self._course
        if course is None:
            return
        try:
            if self._cancelling:
                self._cancelling = False
                progress = course.throw(CancelledError('cancelled by the client'))
            else:
                progress = next(course)
        except StopIteration as ended:
            self._end(ended.value)
            return
        except IsotrussError as error:
            self._end(error)
            return
        goal, stage = self._goal, self._sequences.stage
        goal.publish_feedback(lambda: goal.kind.Feedback(stage=stage, progress=progress))

    def _end(self, ended: Any) -> None:
        """End the goal with the result of the sequence, or with a result for its error."""
        goal, self._course = self._goal, None
        outcome = StepOutcome.SUCCEEDED
        if isinstance(ended, IsotrussError):
            outcome = _find_outcome(ended)
            details = getattr(ended, 'details', {})
            ended = goal.kind.Result(code=outcome, message=str(ended), **details)
        ended.held = HELD_VALUES[self._watch.is_held]
        if hasattr(ended, 'object_pose') and (pose := self._sequences.measured_pose()):
            ended.object_pose = pose
        if isinstance(ended, MoveObject.Result):
            left = self._sequences.distance_left(goal.request.path)
            ended.position_error, ended.angle_error = left
        goal.report_end(outcome, ended, f'{goal.kind.__name__}: ')


def _find_outcome(error: IsotrussError) -> StepOutcome:
    """Return the outcome of a sequence that was ended by an error."""
    if isinstance(error, StepError):
        return error.outcome
    if isinstance(error, CancelledError):
        return StepOutcome.CANCELLED
    if isinstance(error, InputError):
        return StepOutcome.NOT_READY
    bad = isinstance(error, GraspError | MessageError)
    return StepOutcome.BAD_GOAL if bad else StepOutcome.NO_MOTION_FOUND
