# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arrow characters for the directions of planar wrenches."""

from __future__ import annotations

from collections.abc import Sequence
import math

#: Arrows of forces, counter-clockwise from the x axis, and arrows of positive and negative
#: moments.
FORCES, LEFT, RIGHT = '→↗↑↖←↙↓↘', '↺', '↻'


def arrow_of(wrench: Sequence[float]) -> str:
    """
    Return an arrow character for the direction of a planar wrench; empty for zero.

    If the moment m / arm is larger than the force, the arrow shows the sense of rotation.

    :param wrench: (fx, fy, m / arm) [N], with the characteristic radius as arm.
    """
    fx, fy, m = wrench
    force = math.hypot(fx, fy)
    if not 0.0 < math.hypot(force, m) < math.inf:  # nor for NaN
        return ''
    if abs(m) > force:
        return LEFT if m > 0.0 else RIGHT
    return FORCES[round(math.atan2(fy, fx) / (0.25 * math.pi)) % 8]
