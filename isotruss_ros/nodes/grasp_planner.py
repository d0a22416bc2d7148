# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node `grasp_planner`, which searches for grasps of a free object."""

from __future__ import annotations

from dataclasses import replace
import math
from typing import Any, ClassVar

from isotruss_msgs.action import PlanGrasp
from isotruss_ros.core import IsotrussError
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.inputs import InputError
from isotruss_ros.nodes.conversions.plan_messages import read_goal, to_result_message
from isotruss_ros.nodes.framework import common_parameters as common
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.parameters import FixedSpec
from isotruss_ros.nodes.framework.sensors import Inputs
from isotruss_ros.nodes.framework.single_goal import BusyError, SingleGoal
from isotruss_ros.nodes.grasp.searcher import Answer, Searcher, SearchOutcome
from isotruss_ros.workers import MAX_WORKERS

SPECS = (
    common.OBJECT,
    common.OBSTACLES,
    common.OBSTACLE_TIMEOUT,
    common.COMMAND_TIMEOUT,
    FixedSpec('workers', 0, 'Number of search processes; 0: one for each core', (0, MAX_WORKERS)),
)
#: Period at which the node checks whether a search has finished [s].
POLLING_PERIOD = 0.02


class GraspPlanner(ManagedNode):
    """
    Node that executes one grasp search at a time, and refuses other goals meanwhile.

    The search runs in its own thread and processes; a timer checks whether it has finished.

    :cvar searcher_type: type of the search, with the constructor of `Searcher`.
    :ivar searcher: search of the configured node; None before.
    """

    searcher_type: ClassVar[type[Searcher]] = Searcher

    node_name = 'grasp_planner'
    specs = SPECS
    awaited = ('plan_grasp',)
    idle = 'no search'
    searcher: Searcher | None = None

    def configure(self) -> None:
        """Subscribe to the joint states, and offer the action `plan_grasp`."""
        self._described = common.read_described(self.values)
        self._obstacles = common.read_resting_obstacles(self.values)
        self.searcher = self.searcher_type(self.values.workers)
        self.inputs = Inputs(self, self.robot)
        self.inputs.keep('rollers', 'estimate', 'obstacles')
        # Exists while the node is inactive as well, so that a goal that ends then gets its result.
        self._goal = SingleGoal(
            self,
            PlanGrasp,
            'plan_grasp',
            self._read,
            self._refuse,
            self._begin,
            self.searcher.cancel,
        )

    def activate(self) -> None:
        """Accept goals of grasp searches from now on."""
        self.create_steady_timer(POLLING_PERIOD, self._poll)

    def deactivate(self) -> None:
        """End the grasp search and its processes."""
        self.searcher.close()
        if self._goal.active:
            self._end(Answer(SearchOutcome.FAILED, 'the node was deactivated'))

    def destroy_node(self) -> None:
        """Destroy the node, and end the processes of the search."""
        if self.searcher is not None:
            self.searcher.close()
        super().destroy_node()

    def details(self) -> dict[str, object]:
        """Return the progress of the grasp search for the diagnostics."""
        progress, searching = self.searcher.progress(), {'searching': self._goal.active}
        if progress is None:
            return searching  # type: ignore[return-value]
        return {**searching, 'evaluations': progress.evaluations, 'grasps found': progress.found}

    # -- The action --

    def _read(self, goal: PlanGrasp.Goal) -> tuple[Any, ...]:
        """Convert the goal of an action to the arguments of a search."""
        if self._goal.active:
            raise BusyError('another search is running: cancel it, or wait for its end')
        body, needs, *arguments = read_goal(goal, self.robot, self._described)
        now = self.now()
        obstacles = (*self._obstacles, *self.inputs.present_obstacles(now))
        needs = replace(needs, obstacles=obstacles)
        return self.inputs.configuration(now), body, needs, *arguments

    def _refuse(self, error: IsotrussError) -> PlanGrasp.Result:
        missing = isinstance(error, InputError | ConfigurationError)
        outcome = SearchOutcome.NO_JOINT_STATES if missing else SearchOutcome.BAD_GOAL
        if isinstance(error, BusyError):
            outcome = SearchOutcome.FAILED
        return to_result_message(Answer(outcome, str(error)), self.robot)

    def _begin(self, arguments: tuple[Any, ...]) -> None:
        """Start a grasp search."""
        self.searcher.begin(*arguments)
        self.diagnostics.set_status('searching')

    def _poll(self) -> None:
        """Publish feedback of the search, or end the goal with its result."""
        self.inputs.track()
        answer = self.searcher.answer()
        if answer is not None:
            self._end(answer)
        elif self._goal.active:
            progress = self.searcher.progress()
            self._goal.publish_feedback(
                lambda: PlanGrasp.Feedback(
                    evaluations=progress.evaluations,
                    found=progress.found,
                    best=math.nan if progress.best is None else progress.best,
                    progress=progress.share,
                    time_left=math.nan if progress.time_left is None else progress.time_left,
                )
            )

    def _end(self, answer: Answer) -> None:
        """End the active goal with the result of the grasp search."""
        result = to_result_message(answer, self.robot)
        self._goal.report_end(answer.outcome, result)
