# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Smoothing of the corrections of pose and squeeze by two low-pass filters."""

from __future__ import annotations

import math

from isotruss_ros.core.numerics.arrays import Array
import numpy as np


class CorrectionLag:
    """Two low-pass filters in series, for corrections of x, y, angle and squeeze."""

    def __init__(self) -> None:
        self._parts = np.zeros((2, 4))

    @property
    def total(self) -> Array:
        """Return the part (4,) of the corrections not yet in the filter output [m, m, rad, N]."""
        return self._parts.sum(axis=0)

    def add(self, correction: Array) -> None:
        """
        Add a correction to the input of the first filter.

        :param correction: (4,) correction [m, m, rad, N].
        """
        self._parts[0] += correction

    def advance(self, elapsed: float, filter_time: float) -> None:
        """
        Advance both low-pass filters by the elapsed time.

        :param elapsed: time since the last call [s].
        :param filter_time: time constant of each filter [s].
        """
        left = math.exp(-elapsed / filter_time)
        self._parts[1] += (1.0 - left) * self._parts[0]
        self._parts *= left
