# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Frequency and damping ratio of a held object that was plucked."""

import numpy as np
import scipy


def fit_oscillation(times, poses, arm):
    """
    Return frequency [rad/s] and damping ratio of one damped oscillation after a push.

    The coordinates share both; amplitudes and the place of rest follow by linear least squares
    (variable projection). Turns count at the arm [m].
    """
    at, moved = np.asarray(times, dtype=float), np.asarray(poses, dtype=float) * (1.0, 1.0, arm)
    at, moved = at - at[0], moved - moved.mean(axis=0)
    # The strongest frequency of the evenly resampled motion is where to begin.
    even = np.linspace(0.0, at[-1], len(at))
    spread = np.array([np.interp(even, at, each) for each in moved.T])
    power = (np.abs(np.fft.rfft(spread)) ** 2).sum(axis=0)
    first = 2.0 * np.pi * max(int(power.argmax()), 1) / at[-1]

    def left(shape):
        damped, frequency = np.exp(-shape[0] * at), shape[1]
        basis = damped * np.array([np.cos(frequency * at), np.sin(frequency * at)])
        columns = np.column_stack([*basis, np.ones_like(at)])
        return (moved - columns @ np.linalg.lstsq(columns, moved, rcond=None)[0]).ravel()

    found = scipy.optimize.least_squares(left, [0.1 * first, first], x_scale=first)
    decay, damped = found.x
    frequency = float(np.hypot(decay, damped))
    # The motion is that of one mode, and no creep.
    assert found.success
    assert 2.0 * found.cost < 0.5 * (moved**2).sum()
    assert 0.0 <= decay < 0.7 * frequency
    return frequency, decay / frequency
