# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Gains of the squeeze control, from the lowest natural frequency of the held object.

The rollers set velocities: the loop is an integrator in front of a lightly damped structure. With
two low-pass filters of time constant 1 / p on the load and the unexplained pose, and the gain p
of the pose, one mode of the frequency omega and the damping ratio zeta is stable where

    s^3 / p^2 + 3 s^2 / p + 3 s + p omega^2 / (s^2 + 2 zeta omega s + omega^2) = 0

has no root in the right half-plane: for p < 0.54 omega without damping, more with it.
"""

from __future__ import annotations

from typing import NamedTuple

#: Gain relative to the frequency [-]; stable for a frequency wrong by a factor of two.
GAIN_SHARE = 0.25
#: Gain for an unknown frequency [1/s].
DEFAULT_GAIN = 0.6
#: Largest gain of the squeeze [1/s].
MAX_SQUEEZE_GAIN = 5.0


class LoopGains(NamedTuple):
    """
    Gains of the squeeze control.

    :ivar pose: gain of the pose error of the model [1/s].
    :ivar squeeze: gain of the squeeze error [1/s].
    :ivar bias: rate at which the unexplained part of the measured pose is taken over [1/s].
    :ivar filter_time: time constant of each of the two low-pass filters on the load [s].
    """

    pose: float
    squeeze: float
    bias: float
    filter_time: float


def gains_of(gain: float) -> LoopGains:
    """
    Return the gains of the squeeze control for a pose gain.

    :param gain: gain p of the pose, positive [1/s].
    """
    squeeze = min(MAX_SQUEEZE_GAIN, gain)
    return LoopGains(gain, squeeze, 0.5 * squeeze, 1.0 / gain)


def choose_gain(frequency: float | None) -> float:
    """
    Return the gain p [1/s].

    :param frequency: lowest natural frequency of the held object; None if not known [rad/s].
    """
    return DEFAULT_GAIN if frequency is None else GAIN_SHARE * frequency
