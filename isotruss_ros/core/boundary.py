"""
How a margin may be used up: the law that all barriers on shapes share.

A margin h is what is left between a shape and the bound that it must not cross. It may fall at

    dh/dt >= -rate h / (1 - h / band),   h counted from a small reserve on,

that is freely where more than `band` is left, slower and slower inside of it, and not at all at
the reserve. In a loop that is a condition on the next sample too: whatever the motion between
two samples does to the margin in second order, `floor` of it must be left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Share of the band at which motion comes to rest; what is below is for effects of second order.
RESERVE = 0.01
#: Share of a margin that is left after an interval, however long it is, and of the reserve.
KEPT = 0.1
#: Who is beyond the bound must not get further, rounding aside.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Boundary:
    """
    The edge of what is allowed, and how it is come to.

    :ivar least: the smallest value that is allowed.
    :ivar band: a margin larger than this is not watched, in units of the value.
    :ivar rate: a margin shrinks by at most this share of itself in a second [1/s].
    """

    least: float
    band: float
    rate: float = 5.0

    @property
    def end(self) -> float:
        """Return the value from which on it is not watched."""
        return self.least + self.band

    @property
    def reserve(self) -> float:
        """Return the margin at which motion comes to rest."""
        return RESERVE * self.band

    def margin(self, values: Array) -> Array:
        """Return what is left between values and the bound."""
        return values - self.least

    def fall(self, margins: Array) -> Array:
        """Return how quickly margins may get smaller, not negative [1/s]; inf outside the band."""
        return self._fall(np.maximum(margins - self.reserve, 0.0))

    def floor(self, margins: Array, duration: float) -> Array:
        """
        Return what must be left of margins after a while.

        What has got down to a tenth of the reserve must not get further, nor may anything beyond
        the bound; so errors of a fraction of the reserve do no harm.

        :param margins: at its beginning.
        :param duration: how long it is, positive [s].
        """
        last = KEPT * self.reserve
        left = np.maximum(margins, last)
        slowly = left - 2.0 * duration * self._fall(left)
        kept = np.maximum(np.maximum(KEPT * left, slowly), last)
        return np.where(margins > last, kept, margins - ROUNDING)

    def _fall(self, left: Array) -> Array:
        share = np.minimum(left / self.band, 1.0)
        with np.errstate(divide='ignore'):
            return self.rate * left / (1.0 - share)
