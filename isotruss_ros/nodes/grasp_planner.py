# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Node `grasp_planner`: searches for grasps of a free object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
import time

from isotruss_msgs.action import PlanGrasp
from isotruss_ros.core import ConvexObject, IsotrussError, load_robot
from isotruss_ros.core.control.inputs import Input, InputError
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.planning.searcher import Answer, Outcome, Searcher
from isotruss_ros.core.planning.workers import MAX_WORKERS
from isotruss_ros.nodes.components import common_parameters as common
from isotruss_ros.nodes.components.sensors import describe_ages, subscribe_joint_states
from isotruss_ros.nodes.components.single_goal import Ending, SingleGoal
from isotruss_ros.nodes.components.tracked_shape import TrackedShape
from isotruss_ros.nodes.conversions.plan_messages import (
    read_goal,
    to_feedback_message,
    to_result_message,
)
from isotruss_ros.nodes.framework import parameters as params
from isotruss_ros.nodes.framework.cycle import create_steady_timer
from isotruss_ros.nodes.framework.diagnostics import Level
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.runner import run
from rclpy.parameter import Parameter

WORKERS = params.Spec(
    'workers', 0, 'Processes that search, one for each core if 0', read_only=True
)
SPECS = (common.ROBOT, common.OBJECT, common.COMMAND_TIMEOUT, WORKERS)
#: Periods at which the node polls a search, and publishes feedback [s].
PERIOD, FEEDBACK_PERIOD = 0.02, 0.1
#: How the action ends with each outcome; with all others it is aborted.
ENDINGS = {Outcome.FOUND: Ending.SUCCEEDED, Outcome.CANCELLED: Ending.CANCELED}


@dataclass
class PlannerInputs:
    """
    Measured inputs of the planner.

    :ivar timeout: largest age [s].
    :ivar rollers: StampedInput of the RollerState.
    :ivar estimate: input of the `EstimatedTravel` whose offsets these have; None without one.
    """

    timeout: float
    rollers: Input = None
    estimate: Input = None


class GraspPlanner(ManagedNode):
    """
    Execute one goal at a time, and reject others meanwhile.

    The search has a thread and processes of its own; a timer polls it.

    :param parameter_overrides: values of parameters other than the defaults.
    :raises IsotrussError: a parameter is unusable; the text names it and what would be right.
    """

    awaited = ('plan_grasp',)

    def __init__(self, parameter_overrides: Sequence[Parameter] = ()) -> None:
        # First of all: where a parameter is of a wrong type the node is destroyed at once.
        self._searcher: Searcher | None = None
        super().__init__('grasp_planner', SPECS, parameter_overrides)
        self._inputs: PlannerInputs | None = None
        self._described: ConvexObject | None = None
        self._shape: TrackedShape | None = None
        self._goal: SingleGoal | None = None
        self._feedback_time = 0.0
        self.start()

    def configure(self) -> None:
        """Load the robot, subscribe to its joint states, and offer the action."""
        workers = self.values[WORKERS]
        if not 0 <= workers <= MAX_WORKERS:
            raise params.ParameterError(
                f'parameter workers: {workers}: must be from 0 (as many as there are cores) '
                f'to {MAX_WORKERS}'
            )
        self._robot = load_robot(self.values[common.ROBOT])
        self._described = common.read_described(self.values)
        self._searcher = Searcher(workers)
        self._shape = TrackedShape(self._robot)
        self._inputs = PlannerInputs(self.values[common.COMMAND_TIMEOUT])
        self.values.on_change(self._apply)
        subscribe_joint_states(self, self._robot, self._inputs)
        # There while the node is inactive too, so that a goal that ends then gets its result.
        self._goal = SingleGoal(
            self,
            PlanGrasp,
            'plan_grasp',
            ready=lambda: self.active and not self._goal.active,
            begin=self._begin,
            cancelled=self._searcher.cancel,
        )
        self.diagnostics.hardware_id = self._robot.name

    def activate(self) -> None:
        """Accept goals from now on."""
        self.diagnostics.set_status(Level.OK, 'no search')
        create_steady_timer(self, PERIOD, self._poll)

    def deactivate(self) -> None:
        """End the search and its processes."""
        self._abort('the node was deactivated')

    def cleanup(self) -> None:
        """Release the robot."""
        self._goal = self._shape = self._inputs = None

    def destroy_node(self) -> None:
        """Destroy the node and end the processes."""
        if self._searcher is not None:
            self._searcher.close()
        super().destroy_node()

    def details(self) -> dict[str, object]:
        """Return the progress of the search and the age of the joint states."""
        if self._goal is None:
            return {}
        details: dict[str, object] = {'searching': self._goal.active} | describe_ages(
            self.now(), joint_states=self._inputs.rollers
        )
        progress = self._searcher.progress()
        if progress is not None:
            details |= {'evaluations': progress.evaluations, 'grasps found': progress.found}
        return details

    def _apply(self) -> None:
        self._inputs.timeout = self.values[common.COMMAND_TIMEOUT]

    # -- The action --

    def _begin(self, goal: PlanGrasp.Goal) -> None:
        """Begin a search, or abort the goal with the reason."""
        try:
            arguments = read_goal(goal, self._robot, self._described)
        except IsotrussError as error:
            self._end(Answer(Outcome.BAD_GOAL, str(error)))
            return
        try:
            config = self._shape.configuration(
                self.now(), self._inputs.timeout, self._inputs.rollers
            )
        except (InputError, ConfigurationError) as error:
            self._end(Answer(Outcome.NO_JOINT_STATES, str(error)))
            return
        self._searcher.begin(config, *arguments)
        self.diagnostics.set_status(Level.OK, 'searching')

    def _poll(self) -> None:
        """Publish feedback of the search, or end the goal with its answer."""
        self._shape.track(self._inputs.rollers)
        answer = self._searcher.answer()
        if answer is not None:
            self._end(answer)
        elif self._goal.active and time.monotonic() - self._feedback_time >= FEEDBACK_PERIOD:
            self._feedback_time = time.monotonic()
            self._goal.publish_feedback(to_feedback_message(self._searcher.progress()))

    def _abort(self, why: str) -> None:
        """Abort the goal, if there is one, and end the processes."""
        self._searcher.close()
        if self._goal.active:
            self._end(Answer(Outcome.FAILED, why))

    def _end(self, answer: Answer) -> None:
        """Publish the result of the goal."""
        self._goal.end(
            ENDINGS.get(answer.outcome, Ending.ABORTED), to_result_message(answer, self._robot)
        )
        text = f'{answer.outcome.name.lower().replace("_", " ")}: {answer.message}'
        self.report_end('no search', text, good=answer.outcome in ENDINGS)


#: Run the planner until it is interrupted.
main = partial(run, GraspPlanner)
