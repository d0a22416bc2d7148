# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Gains of the squeeze control, from the lowest natural frequency of the held object.

The rollers set velocities: the loop is an integrator in front of a lightly damped structure. With
the load and what it does not explain behind two low-passes of the time 1 / p, and p the gain of
the pose as well, one mode of the frequency omega and the damping ratio zeta is stable where

    s^3 / p^2 + 3 s^2 / p + 3 s + p omega^2 / (s^2 + 2 zeta omega s + omega^2) = 0

has no root to the right: for p < 0.54 omega without damping, more with it.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

from isotruss_ros.core.errors import GainError
import numpy as np
import scipy

#: Gain by frequency: the frequency may be wrong by a factor of two.
SHARE = 0.25
#: The gain where the frequency is not known [1/s].
SLOW = 0.6
#: A gain of the user's own is at most this share of the largest stable one.
LARGEST_SHARE = 0.5
#: Squeeze and bias follow no quicker than this [1/s].
MOST_OF_SQUEEZE, MOST_OF_BIAS = 5.0, 2.0


class LoopGains(NamedTuple):
    """
    How quickly the squeeze control corrects.

    :ivar pose: share of the object's error in the model that is corrected in a second [1/s].
    :ivar squeeze: share of the missing force that is made up for in a second [1/s].
    :ivar bias: share of what the model does not explain of the measured pose that is taken over
        in a second [1/s].
    :ivar filter_time: of each of the two low-passes on the load [s].
    """

    pose: float
    squeeze: float
    bias: float
    filter_time: float


def gains_of(gain: float) -> LoopGains:
    """
    Return all gains.

    :param gain: p, positive [1/s].
    """
    return LoopGains(gain, min(MOST_OF_SQUEEZE, gain), min(MOST_OF_BIAS, 0.5 * gain), 1.0 / gain)


def choose_gain(
    frequency: float | None, damping_ratio: float, own: float | None, forced: bool
) -> float:
    """
    Return the gain p [1/s].

    :param frequency: lowest natural frequency of the held object; None if not known [rad/s].
    :param damping_ratio: of that oscillation, 0 to 1.
    :param own: the user's own gain; None for that of the frequency [1/s].
    :param forced: accept it though it is beyond the limit.
    :raises GainError: it is beyond the limit and not forced; names frequency and limit.
    """
    chosen = SLOW if frequency is None else SHARE * frequency
    if own is None:
        return chosen
    limit = SLOW
    if frequency is not None:
        limit = LARGEST_SHARE * frequency * largest_stable_gain(damping_ratio)
    if own > limit and not forced:
        known = 'is not known' if frequency is None else f'is {frequency:.3g} rad/s'
        raise GainError(
            f'gain {own:g} 1/s: the lowest frequency of the held object {known}, which allows '
            f'{limit:.3g} 1/s; leave the gain to the frequency, or force it'
        )
    return own


@functools.lru_cache(maxsize=16)
def largest_stable_gain(damping_ratio: float) -> float:
    """
    Return the largest p / omega with which one mode is stable.

    :param damping_ratio: of the mode, 0 to 1.
    """

    def growth(gain: float) -> float:
        mode = [1.0, 2.0 * damping_ratio, 1.0]
        loop = np.polymul([1.0 / gain**2, 3.0 / gain, 3.0, 0.0], mode)
        return float(np.roots(np.polyadd(loop, [gain])).real.max())

    return float(scipy.optimize.brentq(growth, 0.1, 20.0))
