"""Node `grasp_planner`: searches for grasps of an object that lies free."""

from __future__ import annotations

from collections.abc import Sequence
import contextlib
import sys
import time

from isotruss_msgs.action import PlanGrasp
from isotruss_ros.core import (
    Configuration,
    ConfigurationError,
    IsotrussError,
    load_robot,
    Refusal,
    Sample,
)
from isotruss_ros.core.samples import Input, InputError, require_fresh, ShapeTracker
from isotruss_ros.nodes import parameters as params
from isotruss_ros.nodes.diagnostics import Level
from isotruss_ros.nodes.inputs import age, latest
from isotruss_ros.nodes.managed import ManagedNode
from isotruss_ros.nodes.messages import MessageError, RollerStates, seconds
from isotruss_ros.nodes.newest import subscribe_newest
from isotruss_ros.nodes.plan_messages import feedback_message, result_message, wanted
from isotruss_ros.nodes.runner import run
from isotruss_ros.nodes.single_goal import Ending, SingleGoal
from isotruss_ros.plan.pool import MAX_WORKERS
from isotruss_ros.plan.searcher import Answer, Outcome, Searcher
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

WORKERS = params.Spec(
    'workers',
    0,
    'Processes that search, a core each; as many as there are cores if 0',
    read_only=True,
)
SPECS = (params.ROBOT, params.COMMAND_TIMEOUT, WORKERS)
#: How often the node looks after a search, and how often it tells of it [s].
PERIOD, FEEDBACK_PERIOD = 0.02, 0.1
#: How the action ends with each outcome; with all others it is aborted.
ENDINGS = {Outcome.FOUND: Ending.SUCCEEDED, Outcome.CANCELLED: Ending.CANCELED}


class GraspPlanner(ManagedNode):
    """
    Pursues one goal at a time, and rejects others meanwhile.

    The search has a thread and processes of its own; a timer looks after it.

    :raises IsotrussError: a parameter is unusable; says which and what would be right.
    """

    def __init__(self, parameter_overrides: Sequence[Parameter] = ()) -> None:
        # First of all: where a parameter is of a wrong type the node is destroyed at once.
        self._searcher: Searcher | None = None
        super().__init__('grasp_planner', SPECS, parameter_overrides)
        self._rollers: Input = None
        self._followed: Input = None
        self._shapes: ShapeTracker | None = None
        self._goal: SingleGoal | None = None
        self._told = 0.0
        self.start()

    def configure(self) -> None:
        """Load the robot, listen to its rollers, and offer the action."""
        workers = self.values[WORKERS]
        if not 0 <= workers <= MAX_WORKERS:
            raise params.ParameterError(
                f'parameter workers: {workers}: must be from 0 (as many as there are cores) '
                f'to {MAX_WORKERS}'
            )
        self._robot = load_robot(self.values[params.ROBOT])
        self._searcher = Searcher(workers)
        self._shapes = ShapeTracker(self._robot)
        self._states = RollerStates(self._robot.roller_names)
        subscribe_newest(self, JointState, 'joint_states', self._take_joint_states)
        # There while the node is inactive too, so that a goal that ends then gets its result.
        self._goal = SingleGoal(
            self,
            PlanGrasp,
            'plan_grasp',
            ready=lambda: self.active and not self._goal.pursued,
            begin=self._begin,
            preempted=lambda: self._give_up('a newer goal took over'),
            cancelled=self._searcher.cancel,
        )
        self.diagnostics.hardware_id = self._robot.name

    def activate(self) -> None:
        """Take goals from now on."""
        self.diagnostics.say(Level.OK, 'no search')
        # By the steady clock: a search takes as long as it takes, in simulated time too.
        self.create_timer(PERIOD, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def deactivate(self) -> None:
        """End the search and its processes."""
        self._give_up('the node was deactivated')

    def cleanup(self) -> None:
        """Let go of the robot."""
        self._goal = self._shapes = self._rollers = self._followed = None

    def destroy_node(self) -> None:
        """Leave no process behind."""
        if self._searcher is not None:
            self._searcher.close()
        super().destroy_node()

    def details(self) -> dict[str, object]:
        """Return what it does and what it goes by."""
        if self._goal is None:
            return {}
        now = 1e-9 * self.get_clock().now().nanoseconds
        found: dict[str, object] = {
            'searching': self._goal.pursued,
            'age of joint states [s]': age(self._rollers, now),
        }
        progress = self._searcher.progress()
        if progress is not None:
            found |= {'evaluations': progress.evaluations, 'grasps found': progress.found}
        return found

    # -- Where the robot is --

    def _take_joint_states(self, message: JointState) -> None:
        try:
            came = Sample(self._states.state(message), seconds(message.header))
            timeout = self.values[params.COMMAND_TIMEOUT]
            self._rollers = latest(self._rollers, came, timeout)
        except MessageError as error:
            self._rollers = Refusal(str(error))

    def _follow(self) -> None:
        """Keep up with the robot: its shape depends on the way there."""
        if self._rollers is self._followed:
            return
        self._followed = self._rollers
        if isinstance(self._rollers, Sample):
            # What cannot be is said when a goal needs it.
            with contextlib.suppress(ConfigurationError):
                self._shapes.configuration(self._rollers.value.positions)

    def _configuration(self) -> Configuration:
        """
        Return where the robot is.

        :raises InputError: that is not known.
        :raises ConfigurationError: it cannot be.
        """
        now = 1e-9 * self.get_clock().now().nanoseconds
        timeout = self.values[params.COMMAND_TIMEOUT]
        state = require_fresh('joint states', self._rollers, now, timeout).value
        return self._shapes.configuration(state.positions)

    # -- The action --

    def _begin(self, goal: PlanGrasp.Goal) -> None:
        """Begin a search, or say why not."""
        try:
            asked = wanted(goal, self._robot)
        except IsotrussError as error:
            self._end(Answer(Outcome.BAD_GOAL, str(error)))
            return
        try:
            config = self._configuration()
        except (InputError, ConfigurationError) as error:
            self._end(Answer(Outcome.NO_JOINT_STATES, str(error)))
            return
        self._searcher.begin(config, *asked)
        self.diagnostics.say(Level.OK, 'searching')

    def _look(self) -> None:
        """Look after the search."""
        self._follow()
        answer = self._searcher.answer()
        if answer is not None:
            self._end(answer)
        elif self._goal.pursued and time.monotonic() - self._told >= FEEDBACK_PERIOD:
            self._told = time.monotonic()
            self._goal.tell(feedback_message(self._searcher.progress()))

    def _give_up(self, why: str) -> None:
        """End the goal, if there is one, and the processes."""
        self._searcher.close()
        if self._goal.pursued:
            self._end(Answer(Outcome.FAILED, why))

    def _end(self, answer: Answer) -> None:
        """Say how the goal ended."""
        self._goal.end(
            ENDINGS.get(answer.outcome, Ending.ABORTED), result_message(answer, self._robot)
        )
        words = f'{answer.outcome.name.lower().replace("_", " ")}: {answer.message}'
        good = answer.outcome in ENDINGS
        self.diagnostics.say(Level.OK if good else Level.WARN, f'no search; last {words}')
        if good:
            self.get_logger().info(words)
        else:
            self.get_logger().warning(words)


def main(args: Sequence[str] | None = None) -> int:
    """Run the planner until it is interrupted."""
    return run(GraspPlanner, args)


if __name__ == '__main__':
    sys.exit(main())
