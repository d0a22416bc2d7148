# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Frequency and damping ratio of a held object that was plucked."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.numerics.arrays import Array
import numpy as np
from numpy.typing import ArrayLike
import scipy

#: Fewer samples tell no oscillation.
MIN_SAMPLES = 20
#: More than this share of the motion must follow one damped oscillation ...
EXPLAINED = 0.5
#: ... with less than this damping ratio: more is creep.
MOST_DAMPING = 0.7


class Oscillation(NamedTuple):
    """
    A damped oscillation.

    :ivar frequency: undamped [rad/s].
    :ivar damping_ratio: against the critical damping [-].
    """

    frequency: float
    damping_ratio: float


def fit_oscillation(times: ArrayLike, poses: ArrayLike, arm: float) -> Oscillation:
    """
    Fit one damped oscillation to the motion of an object after a push.

    The coordinates share frequency and damping; amplitudes and the place of rest follow by linear
    least squares (variable projection).

    :param times: (n,) of the poses, increasing [s].
    :param poses: (n, 3) x, y [m], angle [rad].
    :param arm: by which turns compare with lengths [m].
    :raises SolverError: there are too few samples, or they are no damped oscillation.
    """
    at, moved = np.asarray(times, dtype=float), np.asarray(poses, dtype=float) * (1.0, 1.0, arm)
    if len(at) < MIN_SAMPLES:
        raise SolverError(f'{len(at)} poses: must be {MIN_SAMPLES} or more')
    at, moved = at - at[0], moved - moved.mean(axis=0)
    # The strongest frequency of the evenly resampled motion is where to begin.
    even = np.linspace(0.0, at[-1], len(at))
    spread = np.array([np.interp(even, at, each) for each in moved.T])
    power = (np.abs(np.fft.rfft(spread)) ** 2).sum(axis=0)
    first = 2.0 * np.pi * max(int(power.argmax()), 1) / at[-1]

    def left(shape: Array) -> Array:
        damped, frequency = np.exp(-shape[0] * at), shape[1]
        basis = damped * np.array([np.cos(frequency * at), np.sin(frequency * at)])
        columns = np.column_stack([*basis, np.ones_like(at)])
        return (moved - columns @ np.linalg.lstsq(columns, moved, rcond=None)[0]).ravel()

    found = scipy.optimize.least_squares(left, [0.1 * first, first], x_scale=first)
    decay, damped = found.x
    frequency = float(np.hypot(decay, damped))
    unexplained = 2.0 * found.cost / max(float((moved**2).sum()), np.finfo(float).tiny)
    within = 0.0 <= decay < MOST_DAMPING * frequency
    if not (found.success and within and unexplained < 1.0 - EXPLAINED):
        raise SolverError('the poses are no damped oscillation: push harder, or measure longer')
    return Oscillation(frequency, float(decay / frequency))
