# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fit of the frequency and damping ratio of an oscillation to measured poses."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.core.numerics.arrays import Array, finite_array, finite_rows, MAX_MAGNITUDE
import numpy as np
from numpy.typing import ArrayLike

#: Smallest number of poses for a fit [-].
MIN_POSES = 20
#: Largest valid residual of the fitted oscillation relative to the motion [-].
MAX_RESIDUAL_SHARE = 0.5
#: Largest damping ratio at which the frequency can be identified [-].
MAX_DAMPING_RATIO = 0.7


class Oscillation(NamedTuple):
    """Fitted damped oscillation with one frequency."""

    frequency: float  #: undamped natural frequency [rad/s]
    damping_ratio: float  #: damping ratio [-]
    amplitude: float  #: largest distance from the rest position [m]


def fit_oscillation(times: ArrayLike, poses: ArrayLike, arm: float) -> Oscillation:
    """
    Fit one damped oscillation to the poses of an object after a push.

    All coordinates have the same frequency and damping ratio. Amplitudes and rest position follow
    from these by linear least squares (variable projection, Golub and Pereyra 1973).

    :param times: (n,) times of the poses, ascending [s].
    :param poses: (n, 3) x, y [m] and angle [rad].
    :param arm: characteristic radius of the object, by which rotations are multiplied to obtain
        lengths [m].
    :raises MeasurementError: a number is not finite, the poses are too few, or no single damped
        oscillation fits them.
    """
    moved = finite_rows(poses, 3, 'poses (x, y, angle) [m, rad]', MeasurementError, MAX_MAGNITUDE)
    at = finite_array(times, len(moved), 'times [s]', MeasurementError)
    finite_array([arm], 1, 'arm [m]', MeasurementError, MAX_MAGNITUDE)
    if len(at) < MIN_POSES or not (np.diff(at) > 0.0).all():
        raise MeasurementError(
            f'{len(at)} poses: must be {MIN_POSES} or more, at ascending times, for an oscillation'
        )
    at, moved = at - at[0], (moved - moved.mean(axis=0)) * (1.0, 1.0, arm)

    def split(shape: Array) -> tuple[Array, Array]:
        """Return the fitted coordinates and their residuals for a frequency and damping ratio."""
        damped, frequency = np.exp(-shape[0] * at), shape[1]
        basis = damped * np.array([np.cos(frequency * at), np.sin(frequency * at)])
        columns = np.column_stack([*basis, np.ones_like(at)])
        parts = np.linalg.lstsq(columns, moved, rcond=None)[0]
        return columns[:, :2] @ parts[:2], moved - columns @ parts

    # Dimensionless, so that the tolerances are relative to the motion.
    size = float(np.linalg.norm(moved))
    if size == 0.0:
        raise MeasurementError('the poses are equal: the object must oscillate')
    first = _strongest_frequency(at, moved)
    from scipy import optimize

    found = optimize.least_squares(
        lambda shape: split(shape)[1].ravel() / size, [0.1 * first, first], x_scale=first
    )
    decay, damped = found.x
    frequency = float(np.hypot(decay, damped))
    rest = 2.0 * found.cost
    periods = abs(damped) * at[-1] / (2.0 * np.pi)
    if (
        rest > MAX_RESIDUAL_SHARE
        or periods < 1.0
        or not 0.0 <= decay < MAX_DAMPING_RATIO * frequency
    ):
        raise MeasurementError(
            'the poses are not one damped oscillation: the residual is '
            f'{rest:.0%}, the damping ratio {decay / frequency:.2g}, and {periods:.2g} periods '
            'were measured'
        )
    amplitude = float(np.hypot.reduce(split(found.x)[0], axis=1).max())
    return Oscillation(frequency, decay / frequency, amplitude)


def _strongest_frequency(at: Array, moved: Array) -> float:
    """Return the frequency with the largest amplitude in the resampled motion [rad/s]."""
    even = np.linspace(0.0, at[-1], len(at))
    spread = np.array([np.interp(even, at, each) for each in moved.T])
    power = (np.abs(np.fft.rfft(spread)) ** 2).sum(axis=0)
    return 2.0 * np.pi * max(int(power.argmax()), 1) / at[-1]
