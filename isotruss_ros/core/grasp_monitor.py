"""
Grasp monitor: the answer of the analysis for what is known now, or why there is none.

An answer holds for the very inputs that it was computed from. Once one of them is too old, missing
or unusable, the answer before is gone too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import time

from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.errors import (
    ConfigurationError,
    IsotrussError,
    SolverError,
    StructureError,
)
from isotruss_ros.core.grasp_analysis import analyze_grasp, Cylinder
from isotruss_ros.core.grasp_report import AnalyzedGrasp, GraspCode, GraspReport, Question
from isotruss_ros.core.robot import Robot
from isotruss_ros.core.samples import (
    Doubt,
    Input,
    InputError,
    require_fresh,
    Sample,
    ShapeTracker,
)

#: The code for each doubt about an input.
JOINT_STATES = {
    Doubt.MISSING: GraspCode.NO_JOINT_STATES,
    Doubt.STALE: GraspCode.STALE_JOINT_STATES,
    Doubt.INVALID: GraspCode.INVALID_JOINT_STATES,
}
OBJECT_POSE = {
    Doubt.MISSING: GraspCode.NO_OBJECT_POSE,
    Doubt.STALE: GraspCode.STALE_OBJECT_POSE,
    Doubt.INVALID: GraspCode.INVALID_OBJECT_POSE,
}
EXTERNAL_WRENCH = {
    Doubt.STALE: GraspCode.STALE_EXTERNAL_WRENCH,
    Doubt.INVALID: GraspCode.INVALID_EXTERNAL_WRENCH,
}
#: The code for each error of an analysis; the last is that of any other.
ERRORS = (
    (ConfigurationError, GraspCode.NO_CONFIGURATION),
    (StructureError, GraspCode.MECHANISM),
    (SolverError, GraspCode.NOT_SOLVED),
    (IsotrussError, GraspCode.INVALID_REQUEST),
)
NO_WRENCH = (0.0, 0.0, 0.0)
NO_CONTACT = 'the object touches nothing'


class NoAnswerError(IsotrussError):
    """
    An input gives no answer.

    :ivar code: which of the ways it is.
    """

    def __init__(self, code: GraspCode, message: str) -> None:
        super().__init__(message)
        self.code = code


class GraspMonitor:
    """
    The latest inputs, each a sample, a refusal, or None for none yet, and what follows from them.

    :ivar rollers: sample of the `RollerState`.
    :ivar center: sample of (x, y), the measured centre of the object in the robot frame [m].
    :ivar wrench: sample of (fx, fy, m), the external wrench on the object [N, N m]; zero if None.
    :param robot: the robot.
    :param object_diameter: the object's own diameter [m].
    :param friction: coefficient between tube and object.
    :param spacing: of the candidate points along the tubes [m].
    :param timeout: inputs older than this give no answer [s].
    """

    def __init__(
        self,
        robot: Robot,
        object_diameter: float,
        friction: float,
        spacing: float,
        timeout: float,
    ) -> None:
        self.robot = robot
        self.object_diameter = object_diameter
        self.friction = friction
        self.spacing = spacing
        self.timeout = timeout
        self.rollers: Input = None
        self.center: Input = None
        self.wrench: Input = None
        self._shape = ShapeTracker(robot)
        self._question: Question | None = None
        self._answer = GraspReport(GraspCode.NO_JOINT_STATES, '', 0.0)

    def report(self, now: float) -> GraspReport:
        """
        Return the answer for now; computed only if anything but the time has changed.

        Never raises for an input: whatever is wrong becomes a code and a message.

        :param now: time on the clock of the samples [s].
        """
        try:
            rollers = self._fresh('joint states', self.rollers, now, JOINT_STATES)
            center = self._fresh('object pose', self.center, now, OBJECT_POSE)
            question = Question(
                tuple(rollers.value.positions.tolist()),
                center.value,
                self.object_diameter,
                self.friction,
                self._external_wrench(now),
                self.spacing,
            )
        except NoAnswerError as error:
            return GraspReport(error.code, str(error), now)
        if question != self._question:
            self._answer = _ask(question, self._shape.configuration, self._answer.grasp)
            self._question = question
        answered = self._answer.grasp is not None
        return replace(self._answer, time=min(rollers.time, center.time) if answered else now)

    def what_if(self, question: Question, now: float) -> GraspReport:
        """
        Return the answer to another question; what `report` gives stays as it is.

        :param question: no roller positions at all mean the measured ones, which must be fresh.
        :param now: time on the clock of the samples [s].
        """
        if question.roller_positions:
            return replace(_ask(question, self.robot.configuration), time=now)
        try:
            rollers = self._fresh('joint states', self.rollers, now, JOINT_STATES)
        except NoAnswerError as error:
            return GraspReport(error.code, str(error), now)
        question = question._replace(roller_positions=tuple(rollers.value.positions.tolist()))
        return replace(_ask(question, self._shape.configuration), time=rollers.time)

    def _external_wrench(self, now: float) -> tuple[float, float, float]:
        if self.wrench is None:
            return NO_WRENCH
        return self._fresh('external wrench', self.wrench, now, EXTERNAL_WRENCH).value

    def _fresh(self, what: str, given: Input, now: float, codes: dict[Doubt, GraspCode]) -> Sample:
        """Return an input that can be relied on."""
        try:
            return require_fresh(what, given, now, self.timeout)
        except InputError as error:
            raise NoAnswerError(codes[error.doubt], str(error)) from error


def _ask(
    question: Question,
    find: Callable[[tuple[float, ...]], Configuration],
    last: AnalyzedGrasp | None = None,
) -> GraspReport:
    """
    Return the answer, without its time.

    :param find: turns roller positions into a configuration.
    :param last: a similar grasp, to begin with.
    """
    begin = time.perf_counter()
    try:
        cylinder = Cylinder(question.center, question.diameter)
        config = find(question.roller_positions)
        analysis = analyze_grasp(
            config,
            cylinder,
            question.friction,
            question.external_wrench,
            spacing=question.spacing,
            previous=None if last is None else last.analysis,
        )
    except IsotrussError as error:
        code = next(code for kind, code in ERRORS if isinstance(error, kind))
        return GraspReport(code, str(error), 0.0)
    duration = time.perf_counter() - begin
    grasp = AnalyzedGrasp(config, cylinder, question.spacing, analysis, duration)
    return GraspReport(GraspCode.OK, '' if analysis.contact_lengths else NO_CONTACT, 0.0, grasp)
