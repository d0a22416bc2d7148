# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pose of a browser's camera that shows the whole robot beside the panel."""

from __future__ import annotations

import math

from isotruss_ros.core.numerics.arrays import Points

#: Vertical field of view of the camera [rad].
FIELD_OF_VIEW = math.radians(75.0)
#: Ratio of the size of the view to the size of the robot [-].
PICTURE_SCALE = 1.25
#: Largest ratio of width to height at which a window is treated as an upright phone [-]; wider
#: windows have the panel beside the scene.
PHONE_ASPECT = 0.6
#: Height of the panel at the bottom of an upright screen, relative to the height of the screen
#: [-].
PANEL_SHARE = 0.38
#: Class of the text with the state of the grasp.
STATE_CLASS = 'isotruss-state'
#: Style of the page. The text with the state of the grasp stays in the scene while the panel is
#: scrolled. On upright screens, up to the window width at which viser's layout changes, the panel
#: is below the robot.
STYLE = f"""<style>
.{STATE_CLASS} {{
  position: fixed; left: 0.5em; bottom: 0.5em; max-width: 60%; padding: 0.3em 0.6em; z-index: 9;
  background: #fffc; border-radius: 4px; font-size: 0.9em;
}}
.{STATE_CLASS} strong {{ color: #b00; }}
@media (max-width: 36em) {{
  .{STATE_CLASS} {{ top: 0.5em; bottom: auto; max-width: 90%; }}
  [style*="max-height: 60%"] {{
    width: 100% !important; max-height: {100.0 * PANEL_SHARE:.0f}% !important;
  }}
  [style*="max-height: 60%"] [style*="width: 20em"] {{ width: 100% !important; }}
}}
</style>
"""

Place = tuple[float, float, float]


def place_camera(points: Points, aspect: float) -> tuple[Place, Place]:
    """
    Return position and target of a camera above a robot that shows the whole robot [m].

    :param points: (k,) points of the robot in its plane, x + iy [m].
    """
    x, y = (0.5 * (float(part.max()) + float(part.min())) for part in (points.real, points.imag))
    width, height = (
        PICTURE_SCALE * float(part.max() - part.min()) for part in (points.real, points.imag)
    )
    free = 1.0 if aspect > PHONE_ASPECT else 1.0 - PANEL_SHARE
    shown = max(width / aspect, height / free)
    # The centre of the free area is above that of the picture.
    y -= 0.5 * (1.0 - free) * shown
    distance = 0.5 * shown / math.tan(0.5 * FIELD_OF_VIEW)
    # Viewed slightly from below, so that heights are visible.
    return (x, y - 0.2 * distance, distance), (x, y, 0.0)
