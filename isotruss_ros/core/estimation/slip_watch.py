# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which rollers slip: what their estimated zeros do while they turn."""

from __future__ import annotations

from collections import deque

from isotruss_ros.core.numerics.arrays import Array
import numpy as np
import scipy

#: So seldom a zero that stays seems to have moved against its roller, in a comparison. There are
#: some twenty in a second that do not depend on each other: one false alarm in an hour.
RARE = 1.5e-5
#: A roller slips where its zero has moved by more than so many standard deviations ...
SURE = -float(scipy.special.ndtri(RARE))
#: ... and by more than this share of its travel over one of these times [-], [s], ...
SPANS = ((0.3, 0.25), (0.01, 4.0))
#: ... and by more than this at all [m].
LEAST = 1e-3


class SlipWatch:
    """
    Compares zeros of rollers with those a while ago.

    :ivar slipping: (r,) whether each roller seems to slip.
    :param count: of rollers.
    """

    def __init__(self, count: int) -> None:
        self.slipping = np.zeros(count, dtype=bool)
        self._kept: deque[tuple[float, Array, Array, Array]] = deque()

    def add(self, time: float, travel: Array, zeros: Array, variances: Array) -> None:
        """
        Take an estimate in.

        :param time: [s].
        :param travel: (r,) readings of the encoders [m].
        :param zeros: (r,) estimated [m].
        :param variances: (r,) of these [m^2].
        """
        kept = self._kept
        while kept and time - kept[0][0] > SPANS[-1][1]:
            kept.popleft()
        self.slipping = np.zeros(len(zeros), dtype=bool)
        for share, span in SPANS if kept else ():
            before = (each for each in reversed(kept) if time - each[0] >= span)
            _, turned, zeros_then, variances_then = next(before, kept[0])
            moved, way = zeros - zeros_then, travel - turned
            sure = np.abs(moved) > SURE * np.sqrt(variances + variances_then)
            much = np.abs(moved) > np.maximum(LEAST, share * np.abs(way))
            # A tube that slips lags behind its roller.
            self.slipping |= sure & much & (moved * way < 0.0)
        kept.append((time, travel, zeros, variances))
