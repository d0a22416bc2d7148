"""
Fit the local stiffness of a tube to cylinders that were pressed into its side.

The beam is known from the other modes; what is left is how the section flattens, one factor on the
theory of `flattening` for all pressures, cylinders and depths.
"""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.calibration.measurements import MeasurementError, Presses
from isotruss_ros.calibration.pressed_tube import ClampedTube, press
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.statics.tube_stiffness import InflatableBeam
import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student_t

#: The factor is sought within this of the theory.
RANGE = 1e3
#: Where a tenth more of the factor changes no load by this share, the points do not show it.
INDIFFERENT = 1e-3


@dataclass(frozen=True)
class FittedLocalStiffness:
    """
    The local stiffness against that of the theory, and how well it is known.

    :ivar value: the factor [-].
    :ivar low: lower end of its confidence interval.
    :ivar high: upper end.
    :ivar misfit: root mean square of ln(measured / fitted load).
    :ivar count: number of points.
    """

    value: float
    low: float
    high: float
    misfit: float
    count: int


def fit_local_stiffness(
    presses: Presses, beam: InflatableBeam, confidence: float = 0.95
) -> FittedLocalStiffness:
    """
    Fit the factor on the local stiffness.

    :param presses: the points, cylinders pressed into the middle of a clamped tube.
    :param beam: the tube as a beam.
    :param confidence: of the interval.
    :raises MeasurementError: the points do not determine the factor.
    """
    target = np.log(presses.loads)
    count = len(target)
    if count < 3:
        raise MeasurementError(f'{count} points of interference: must be three or more')
    found = least_squares(
        lambda logs: np.log(_loads(presses, beam, float(np.exp(logs[0])))) - target,
        [0.0],
        bounds=(-np.log(RANGE), np.log(RANGE)),
        x_scale=0.1,
        diff_step=1e-3,
    )
    slope = float(np.linalg.norm(found.jac))
    if slope < INDIFFERENT * np.sqrt(count):
        raise MeasurementError(
            'the loads do not depend on the local stiffness: the tube bends and does not flatten; '
            'press a shorter piece, or narrower cylinders'
        )
    freedom = count - 1
    error = np.sqrt(found.fun @ found.fun / freedom) / slope
    width = student_t.ppf(0.5 + 0.5 * confidence, freedom) * error
    value = float(found.x[0])
    return FittedLocalStiffness(
        float(np.exp(value)),
        float(np.exp(value - width)),
        float(np.exp(value + width)),
        float(np.sqrt(np.mean(found.fun**2))),
        count,
    )


def _loads(presses: Presses, beam: InflatableBeam, factor: float) -> Array:
    """Return the loads (n,) that the points should have [N]."""
    return np.array(
        [
            depth
            * press(
                ClampedTube(beam, beam.radius, length, factor),
                pressure,
                0.5 * length,
                cylinder,
                depth,
            ).stiffness
            for pressure, length, cylinder, depth in zip(
                presses.pressures, presses.lengths, presses.cylinders, presses.depths, strict=True
            )
        ]
    )
