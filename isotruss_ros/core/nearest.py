"""The point of a straight side that is nearest to another point."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Points = NDArray[np.complex128]

#: Points closer than this are one [m]; it keeps directions between them finite.
TINY = 1e-12


class Nearest(NamedTuple):
    """
    The point of a straight side that is nearest to a point; arrays over pairs.

    :ivar away: from there to the point [m].
    :ivar distance: the length of that [m].
    :ivar share: where it is along the side, 0 to 1.
    :ivar along: the side, from begin to end [m].
    """

    away: Points
    distance: Array
    share: Array
    along: Points

    @property
    def normal(self) -> Points:
        """Return the unit vector toward the point, across the side where the point is on it."""
        across = 1j * self.along / np.abs(self.along)
        return np.where(self.distance > TINY, self.away / np.maximum(self.distance, TINY), across)


def nearest_on_side(point: Points, start: Points, along: Points) -> Nearest:
    """
    Return the nearest points of straight sides.

    :param point: (k,) [m].
    :param start: (k,) where the sides begin [m].
    :param along: (k,) from begin to end [m].
    """
    arm = point - start
    share = (along.conj() * arm).real / (along.real**2 + along.imag**2)
    share = np.minimum(np.maximum(share, 0.0), 1.0)
    away = arm - share * along
    return Nearest(away, np.abs(away), share, along)
