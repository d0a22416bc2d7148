# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Residuals of a measured run against a prediction, in standard deviations."""

from __future__ import annotations

from dataclasses import dataclass
import math

from isotruss_ros.core.estimation.state_estimate import EstimatorSettings
from isotruss_ros.core.holding.friction_range import FrictionRange
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.identification.measured_run import MeasuredRun
from isotruss_ros.identification.rolled_run import Parameters, Prediction
import numpy as np

#: Error of the required friction relative to its value, the bound in MuJoCo (docs/plant.md) [-].
FRICTION_ERROR = 0.03
#: Error of a pressure sensor relative to the pressure [-].
PRESSURE_ERROR = 0.01
#: Correlation time of the errors of the model relative to the duration of the run [-].
CORRELATION = 0.1
#: Distance from the prediction at which an object is lost [m].
LOST = 0.02
#: Smallest change of the distance that belongs to the loss, relative to the median change [-].
LOST_STEP = 6.0


def find_loss(run: MeasuredRun, prediction: Prediction) -> int | None:
    """Return the last interval before the object leaves the prediction; None: it does not."""
    offset = (run.poses - prediction.poses)[:, :2]
    far = np.flatnonzero(np.hypot(*offset.T) > LOST)
    if not run.slips and not len(far):
        return None
    last = int(far[0]) if len(far) else len(offset) - 1
    changes = np.hypot(*np.diff(offset, axis=0).T)
    bound = max(LOST_STEP * float(np.median(changes)), EstimatorSettings().pose_error)
    while last > 0 and changes[last - 1] > bound:
        last -= 1
    return last


@dataclass(frozen=True, eq=False)
class Residuals:
    """
    Rows of the least-squares problem: poses, squeeze, friction, pressures.

    The errors of the model are those of the control loop's estimator. They are correlated over
    `CORRELATION` of the run, so n intervals count as 1 / `CORRELATION` independent ones.
    """

    run: MeasuredRun
    used: int  #: number of intervals before a loss
    lost: int | None  #: last interval before the loss; None: the object was held
    measured: Array  #: (k,) measured values
    deviations: Array  #: (k,) their standard deviations; infinite: not measured

    @classmethod
    def of(
        cls, run: MeasuredRun, nominal: Prediction, lost: int | None, known: FrictionRange | None
    ) -> Residuals:
        """Return the rows of a run with the friction range at its loss."""
        used = nominal.count if lost is None else min(lost + 1, nominal.count)
        model, spread = EstimatorSettings(), math.sqrt(max(CORRELATION * used, 1.0))
        errors = spread * model.pose_error * np.array([1.0, 1.0, 1.0 / run.grip.body.arm])
        squeeze = run.squeeze[:used]
        is_read = np.isfinite(squeeze)
        by_squeeze = spread * model.squeeze_error * nominal.squeeze[:used]
        # A held object shows only that the friction is at least the required one.
        required = nominal.required[:used]
        is_shown = run.friction < required.max() or (lost is not None and run.friction >= 0.0)
        pressure = np.zeros(2) if run.pressure is None else run.pressure
        by_pressure = np.inf if run.pressure is None else PRESSURE_ERROR
        # Between two members, slow changes lose the object at `necessary` after every history.
        is_wide = known is not None and len(run.grip.members) > 2
        width = known.sufficient - known.necessary if is_wide else 0.0
        by_friction = math.hypot(FRICTION_ERROR * run.friction, 0.5 * width)
        rows = (
            (run.poses[:used].ravel(), np.hypot(run.deviations[:used], errors).ravel()),
            (np.where(is_read, squeeze, 0.0), np.where(is_read, by_squeeze, np.inf)),
            ([np.nan_to_num(run.friction)], [by_friction if is_shown else np.inf]),
            (pressure, [by_pressure, by_pressure]),
        )
        measured, deviations = (np.concatenate(part) for part in zip(*rows, strict=True))
        lost = None if lost is None else used - 1
        return cls(run, used, lost, measured, deviations)

    def at(self, prediction: Prediction, values: Array) -> Array:
        """Return the residuals (k,) in deviations for parameters (p,)."""
        required = prediction.required[: self.used]
        predicted = np.concatenate(
            [
                prediction.poses[: self.used].ravel(),
                prediction.squeeze[: self.used],
                [required.max() if self.lost is None else required[self.lost]],
                values[Parameters.of(self.run).pressure],
            ]
        )
        return (self.measured - predicted) / self.deviations
