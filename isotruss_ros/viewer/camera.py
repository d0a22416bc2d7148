# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where the camera of a browser is, so that the whole robot is beside the panel."""

from __future__ import annotations

import math

from isotruss_ros.core.numerics.arrays import Points

#: Vertical field of view of the page [rad].
FIELD = math.radians(75.0)
#: The picture is so much wider and higher than the robot.
ROOM = 1.25
#: Share of the height of an upright screen that the panel covers, from below.
COVERED = 0.38
#: Upright screens have the panel below the robot, see `STYLE`; the breakpoint is that of viser.
STYLE = f"""<style>
@media (max-width: 36em) {{
  [style*="max-height: 60%"] {{
    width: 100% !important; max-height: {100.0 * COVERED:.0f}% !important;
  }}
  [style*="max-height: 60%"] [style*="width: 20em"] {{ width: 100% !important; }}
}}
</style>
"""

Place = tuple[float, float, float]


def place_camera(points: Points, aspect: float) -> tuple[Place, Place]:
    """
    Return position and target of a camera above a robot [m].

    :param points: (k,) of the robot in its plane [m].
    :param aspect: width over height of the picture.
    """
    x, y = (0.5 * (float(part.max()) + float(part.min())) for part in (points.real, points.imag))
    width, height = (ROOM * float(part.max() - part.min()) for part in (points.real, points.imag))
    free = 1.0 if aspect >= 1.0 else 1.0 - COVERED
    shown = max(width / aspect, height / free)
    # The middle of what the panel leaves free is above that of the picture.
    y -= 0.5 * (1.0 - free) * shown
    distance = 0.5 * shown / math.tan(0.5 * FIELD)
    # Seen from a little below, so that heights show.
    return (x, y - 0.2 * distance, distance), (x, y, 0.0)
