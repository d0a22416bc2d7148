# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Directions of planar wrenches as characters."""

from __future__ import annotations

from collections.abc import Sequence
import math

#: Arrows of forces, counter-clockwise from the x axis, and arrows of positive and negative
#: moments.
FORCES, LEFT, RIGHT = '→↗↑↖←↙↓↘', '↺', '↻'


def arrow_of(wrench: Sequence[float]) -> str:
    """
    Return an arrow for a planar wrench; empty for a zero wrench.

    :param wrench: (fx, fy, m / arm) [N]; a moment larger than the force is shown instead.
    """
    fx, fy, m = wrench
    force = math.hypot(fx, fy)
    if not 0.0 < math.hypot(force, m) < math.inf:  # nor for NaN
        return ''
    if abs(m) > force:
        return LEFT if m > 0.0 else RIGHT
    return FORCES[round(math.atan2(fy, fx) / (0.25 * math.pi)) % 8]
