# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Observation of the object of a sequence: whether it is held, and its pose."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
import time
from typing import Any, NamedTuple

from isotruss_ros.core import Pose
from isotruss_ros.core.inputs import find_fresh, Input, InputError, require_fresh, StampedInput
from isotruss_ros.core.model.pose import pose_difference
from isotruss_ros.nodes.conversions.messages import read_held
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.sensors import Inputs
from isotruss_ros.nodes.pick_and_place.action_steps import StepError, StepOutcome, Steps
import numpy as np

#: Longest wait until the grasp analysis confirms that the object is held or is free [s].
CONFIRMATION_TIMEOUT = 5.0
#: Longest wait for missing or stale inputs before a motion [s].
INPUT_TIMEOUT = 1.0
#: Time for which poses of the object at rest are averaged [s]. A tracker of 30 Hz gives 15 poses,
#: whose mean has a quarter of the noise of one; a third of the time gives half of the noise.
AVERAGING_TIME = 0.5


class AveragePose(NamedTuple):
    """Mean of measured poses of an object at rest."""

    pose: Pose  #: mean pose
    noise: float  #: standard deviation of a coordinate of one pose [m]; 0 for a single pose
    number: int  #: number of poses

    @classmethod
    def of(cls, poses: Sequence[Pose]) -> AveragePose:
        """Return the mean of poses that differ by noise."""
        offsets = np.array([pose_difference(pose, poses[0]) for pose in poses])
        noise = float(offsets[:, :2].std(axis=0, ddof=1).max()) if len(poses) > 1 else 0.0
        x, y, angle = np.add(poses[0], offsets.mean(axis=0)).tolist()
        return cls(Pose(x, y, angle), noise, len(poses))

    def distance(self, other: AveragePose) -> tuple[float, float]:
        """Return the distance to another mean, and its standard deviation [m]."""
        x, y, _ = pose_difference(self.pose, other.pose).tolist()
        variances = [mean.noise**2 / mean.number for mean in (self, other)]
        return math.hypot(x, y), math.sqrt(sum(variances))


class ObjectWatch:
    """
    Observation of the object by the inputs of a node.

    :param node: node with the parameter `command_timeout`, the largest age of inputs [s].
    """

    def __init__(self, node: ManagedNode, inputs: Inputs) -> None:
        self._node, self.inputs = node, inputs
        self._held_at = 0.0  # last time at which the moving object was known to be held [s]

    @property
    def timeout(self) -> float:
        """Return the largest admissible age of inputs [s]."""
        return self._node.values.command_timeout

    def require_free(self) -> None:
        """Raise StepError if the object is already held."""
        # The analysis may arrive only after the pick.
        state = find_fresh(self._node.now(), self.timeout, self.inputs.grasp)
        if state is not None and read_held(state):
            members = ', '.join(state.grasping_members)
            raise StepError(
                StepOutcome.BAD_GOAL,
                f'the object is already held by {members}: first place the object',
            )

    def confirm(self, held: bool) -> Steps:
        """
        Wait until an analysis of the robot at rest reports the object as held, or as free.

        The squeeze of a held object gets its deviation from the grip of `manipulation`, which may
        be published later; without a grip, the last analysis is returned after the timeout.
        """
        arrived = self._node.now()
        while True:
            now, analysed, confirmed = self._node.now(), -np.inf, False
            if isinstance(self.inputs.grasp, StampedInput):
                state, analysed = self.inputs.grasp.value, self.inputs.grasp.time
                confirmed = read_held(state) is held and analysed > arrived
                if confirmed and not (held and math.isnan(state.squeeze_deviation)):
                    return state
            # The wait is timed by the stamps of the analyses, which are late on a busy machine, or
            # by the clock if no analyses arrive.
            waited = max(analysed, now - self.timeout) - arrived
            if waited > CONFIRMATION_TIMEOUT:
                if confirmed:
                    return state
                has_answer = analysed > arrived and read_held(state) is not None
                outcome = StepOutcome.NOT_HELD if has_answer else StepOutcome.NOT_READY
                raise StepError(outcome, self._describe_grasp(arrived))
            yield min(1.0, max(0.0, waited / CONFIRMATION_TIMEOUT))

    def await_inputs(self, **inputs: Callable[[], Input]) -> Steps:
        """Wait for fresh roller positions, object pose and other inputs, with a timeout."""
        begun = time.monotonic()
        while True:
            try:
                return require_fresh(
                    self._node.now(),
                    self.timeout,
                    joint_states=self.inputs.rollers,
                    object_pose=self.inputs.pose,
                    **{name: find() for name, find in inputs.items()},  # type: ignore[arg-type]
                )
            except InputError:
                if time.monotonic() - begun > INPUT_TIMEOUT:
                    raise
            yield 0.0

    def await_held(self, otherwise: StepOutcome) -> Steps:
        """Wait until it is known whether the object is held; return the analysis if it is."""
        begun = time.monotonic()
        while True:
            *_, grasp = yield from self.await_inputs(grasp_state=lambda: self.inputs.grasp)
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
        now, inputs = self._node.now(), self.inputs
        reports = (
            find_fresh(now, self.timeout, it) for it in (inputs.grasp, inputs.servo_feedback)
        )
        return [report for report in reports if report is not None]

    def begin_motion(self) -> None:
        """Start the watch of a motion of the held object."""
        self._held_at = self._node.now()

    def find_loss(self) -> StepError | None:
        """Return an error if the object is lost, or if its hold is unknown for the timeout."""
        now, held = self._node.now(), self.is_held
        if held is False:
            return StepError(StepOutcome.NOT_HELD, self._describe_grasp())
        if held or now < self._held_at:
            self._held_at = now
        if now - self._held_at <= self.timeout:
            return None
        return StepError(StepOutcome.STOPPED, self._describe_grasp())

    def _describe_grasp(self, since: float = -np.inf) -> str:
        """Return a text about the hold; with a time [s], by an analysis that is later."""
        lost = [report for report in self._fresh_reports() if read_held(report) is False]
        analysis = self.inputs.grasp
        if lost:
            why = lost[0].message or getattr(lost[0], 'hold_message', '')
            return f'the object is not held: {why}'
        unknown = 'it is unknown whether the object is held'
        if not isinstance(analysis, StampedInput):
            return f'{unknown}: no analysis of the grasp was received'
        if analysis.time <= since:
            return f'{unknown}: no analysis of the grasp was received since the rollers arrived'
        if self.is_held:
            return f'the object is held, with a slip margin of {analysis.value.slip_margin:.3g} N'
        why = analysis.value.message or 'no result'
        return (
            f'{unknown}: {why}; the last analysis is {self._node.now() - analysis.time:.2f} s old'
        )

    def average_poses(self) -> Steps:
        """Average the measured poses of the object at rest for `AVERAGING_TIME`."""
        poses: dict[float, Pose] = {}
        begun = self._node.now()
        while not poses or 0.0 <= self._node.now() - begun < AVERAGING_TIME:
            _, measured = yield from self.await_inputs()
            poses[measured.time] = measured.value
            yield 0.0
        return AveragePose.of(list(poses.values()))
