# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Gains of the squeeze control, from the lowest natural frequency of the held object.

Commands are roller velocities, so the loop is an integrator in front of a lightly damped
structure. The loop has the pose gain p. The estimated load, and the part of the measured pose that
neither load nor contacts explain (unexplained pose), pass two low-pass filters with the time
constant 1 / p. A mode with the frequency omega and the damping ratio zeta is stable if

    s^3 / p^2 + 3 s^2 / p + 3 s + p omega^2 / (s^2 + 2 zeta omega s + omega^2) = 0

has no root in the right half-plane. Without damping this holds for p < 0.54 omega; with damping it
holds up to a larger p. The gain of the squeeze is p, up to `MAX_SQUEEZE_GAIN`.
"""

from __future__ import annotations

#: Ratio of the pose gain to the natural frequency [-]. The loop is stable even if the frequency is
#: wrong by a factor of two.
GAIN_SHARE = 0.25
#: Lowest natural frequency that is assumed if it is unknown [rad/s].
DEFAULT_FREQUENCY = 2.4
#: Largest gain of the squeeze [1/s].
MAX_SQUEEZE_GAIN = 5.0
