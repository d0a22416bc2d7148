# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Grasp monitor, which analyses the grasp from the latest inputs or reports their fault.

A result is valid only for the inputs from which it was computed. It is discarded when an input is
stale, missing or rejected.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import math
import time
from typing import Any

from isotruss_ros.core.chance.uncertainty import Uncertainty
from isotruss_ros.core.errors import (
    ConfigurationError,
    GraspError,
    IsotrussError,
    SolverError,
    StructureError,
)
from isotruss_ros.core.fixed_object.analyze_grasp import analyze_grasp, NO_CONTACT
from isotruss_ros.core.holding.grip_record import GripRecord
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.holding.settle_grasp import assess_equilibrium, settle_grasp
from isotruss_ros.core.holding.settled_grasp import SettledGrasp
from isotruss_ros.core.inputs import (
    find_fresh,
    fresh_pressures,
    InputError,
    LatestInputs,
    PRESSURE_TIMEOUT,
    require_fresh,
)
from isotruss_ros.core.kinematics.configuration import Configuration, ConfigurationTracker
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.statics.wrinkling import MAX_UTILISATION
from isotruss_ros.nodes.grasp.grasp_report import (
    AnalyzedGrasp,
    GraspCode,
    GraspQuery,
    GraspReport,
    INPUT_CODES,
)
import numpy as np

#: Code of a report for each error of the analysis; the last entry applies to all other errors.
ERRORS = (
    (ConfigurationError, GraspCode.NO_CONFIGURATION),
    (StructureError, GraspCode.MECHANISM),
    (SolverError, GraspCode.NOT_SOLVED),
    (IsotrussError, GraspCode.INVALID_REQUEST),
)
#: Smallest change of an unknown of the held grip that causes a new analysis [m, rad, N].
MIN_GRIP_CHANGE = 1e-5


class GraspMonitor:
    """
    Analysis of the grasp from the latest value of each input.

    :ivar query: settings of the analysis; its roller positions, pose, wrench and pressures are
        replaced by the inputs.
    :param timeout: largest age of inputs [s].
    """

    def __init__(
        self, robot: Robot, query: GraspQuery, timeout: float, inputs: LatestInputs
    ) -> None:
        self.robot, self.query, self.timeout, self.inputs = robot, query, timeout, inputs
        self.pressure_timeout = PRESSURE_TIMEOUT  #: largest age of pressures [s]
        self._tracker = ConfigurationTracker(robot.home)
        self._answered: GraspQuery | None = None
        self._record: GripRecord | None = None
        self._report = GraspReport(GraspCode.NO_JOINT_STATES, '', 0.0)

    @single_threaded
    def report(self, now: float) -> GraspReport:
        """
        Return the current analysis, which is recomputed only if inputs or settings have changed.

        Invalid inputs raise no error; the report then has a code and a message.
        """
        latest = self.inputs
        inputs: dict[str, Any] = {'joint_states': latest.rollers, 'object_pose': latest.pose}
        if latest.wrench is not None:
            inputs['external_wrench'] = latest.wrench
        try:
            rollers, pose, *wrench = require_fresh(now, self.timeout, **inputs)
            pressures = fresh_pressures(now, self.pressure_timeout, latest.pressures)
            body = self.query.body.moved_to(pose.value)
        except InputError as error:
            return GraspReport(INPUT_CODES[error.name, error.fault], str(error), now)
        except GraspError as error:
            return GraspReport(GraspCode.INVALID_REQUEST, str(error), now)
        query = self.query._replace(
            roller_positions=tuple(rollers.value.positions.tolist()),
            body=body,
            external_wrench=wrench[0].value if wrench else self.query.external_wrench,
            pressures=pressures,
        )
        record = find_fresh(now, self.timeout, latest.held_grip)
        if query != self._answered or not _alike(record, self._record):
            self._report = _analyze(query, self._tracker.configuration, record)
            self._answered, self._record = query, record
        if self._report.grasp is None:
            return replace(self._report, time=now)
        report = replace(self._report, time=min(rollers.time, pose.time))
        if record is None or record.estimate is None:
            return report
        deviation, is_assumed = record.estimate.squeeze_deviation, record.is_assumed
        return replace(report, squeeze_deviation=deviation, is_squeeze_assumed=is_assumed)

    @single_threaded
    def analyze_request(self, query: GraspQuery, now: float) -> GraspReport:
        """
        Return the grasp analysis for a request, independently of `report`.

        Without roller positions in the request, the measured ones are used and must be fresh, as
        must be pressures after their first message.
        """
        try:
            pressures = fresh_pressures(now, self.pressure_timeout, self.inputs.pressures)
            query = query._replace(pressures=pressures)
            if query.roller_positions:
                return replace(_analyze(query, self.robot.configuration), time=now)
            (rollers,) = require_fresh(now, self.timeout, joint_states=self.inputs.rollers)
        except InputError as error:
            return GraspReport(INPUT_CODES[error.name, error.fault], str(error), now)
        query = query._replace(roller_positions=tuple(rollers.value.positions.tolist()))
        return replace(_analyze(query, self._tracker.configuration), time=rollers.time)


def _analyze(
    query: GraspQuery,
    find: Callable[[tuple[float, ...]], Configuration],
    record: GripRecord | None = None,
) -> GraspReport:
    """
    Return the report of an analysis; its time is set by the caller.

    :param record: equilibrium reported by the control loop that holds the object, which is solved
        for only under a wrench; None without such a loop.
    """
    begin = time.perf_counter()
    try:
        config = find(query.roller_positions)
        analysis = analyze_grasp(
            config,
            query.body,
            query.friction,
            query.external_wrench,
            pressure=query.pressures,
            spacing=query.spacing,
        )
        held = None if record is None else record.restore(config, query.body)
        if held is not None and any(query.external_wrench):
            held = roll_grip(held, config, np.array(query.external_wrench))
        if held is None:
            settled = settle_grasp(
                config,
                query.body,
                query.friction,
                query.external_wrench,
                pressure=query.pressures,
            )
        else:
            settled = assess_equilibrium(query.body.pose, held, query.friction)
        chance = _find_chance(query, config, settled, held)
    except IsotrussError as error:
        code = next(code for kind, code in ERRORS if isinstance(error, kind))
        return GraspReport(code, str(error), 0.0)
    duration = time.perf_counter() - begin
    grasp = AnalyzedGrasp(config, query.body, analysis, settled, duration, chance)
    code, message = _judge(grasp)
    return GraspReport(code, message, 0.0, grasp)


def _find_chance(
    query: GraspQuery, config: Configuration, settled: SettledGrasp, held: HeldGrip | None
) -> float:
    """Return the chance to first order; NaN without uncertainty or without derivatives."""
    body, robot = query.body, config.robot
    if not (robot.description.uncertainty or body.uncertainty):
        return math.nan
    if held is not None:  # its contact history is unknown to the model of the uncertainty
        settled = settle_grasp(
            config,
            body.moved_to(held.pose),
            query.friction,
            query.external_wrench,
            pressure=query.pressures,
            members=held.member_names,
        )
    try:
        return float(settled.chance(Uncertainty.of(robot, body), samples=0).probability)
    except GraspError:  # there is no equilibrium, or a neutral one
        return math.nan


def _alike(record: GripRecord | None, other: GripRecord | None) -> bool:
    """Return whether poses, contacts and forces of two grips agree within `MIN_GRIP_CHANGE`."""
    if record is None or other is None:
        return record is other
    if len(record.unknowns) != len(other.unknowns):
        return False
    return bool((np.abs(record.unknowns - other.unknowns) < MIN_GRIP_CHANGE).all())


def _judge(grasp: AnalyzedGrasp) -> tuple[GraspCode, str]:
    """Return the report code of a grasp analysis, and a text with its warnings."""
    settled = grasp.settled
    if settled.equilibrium is None:
        touched = bool(grasp.analysis.contact_lengths)
        return GraspCode.OK, f'no equilibrium: {settled.reason}' if touched else NO_CONTACT
    member, used = max(settled.utilisation.items(), key=lambda item: item[1])
    if used <= MAX_UTILISATION:
        flat = ', '.join(settled.flattened)
        return (
            GraspCode.OK,
            f'{flat}: the section is flat at the contact; the forces are too large'
            if flat
            else '',
        )
    message = (
        f'member {member}: bending moment of {used:.2f} times its wrinkling moment, '
        f'{settled.utilisation_places[member]:.3g} m from its start'
    )
    if used <= 1.0:
        return GraspCode.OK, message
    return GraspCode.WRINKLED, f'{message}; the tube wrinkles, so the model is invalid'
