"""Arrays at the borders: numbers that callers hand over, and points as pairs of numbers."""

from __future__ import annotations

from isotruss_ros.core.errors import GraspError, IsotrussError
import numpy as np
from numpy.typing import ArrayLike, NDArray

#: No object is smaller or farther away [m]; products of such numbers neither vanish nor overflow.
MIN_DIAMETER, MAX_DISTANCE = 1e-9, 1e9


def finite_array(
    values: ArrayLike, count: int, what: str, error: type[IsotrussError]
) -> NDArray[np.float64]:
    """
    Return a copy of `count` finite real numbers as an array (count,).

    :param what: what the numbers are, for the message.
    :param error: the exception to raise.
    :raises IsotrussError: of the given class; names what was given and what would be right.
    """
    array = np.asarray(values)
    fits = array.dtype.kind in 'iuf' and array.shape == (count,) and np.isfinite(array).all()
    if not fits:
        given = repr(values)
        given = given if len(given) <= 80 else given[:77] + '...'
        raise error(f'{what}: {given}: must be {count} finite numbers')
    return array.astype(np.float64)


def circle(center: ArrayLike, diameter: float) -> tuple[tuple[float, float], float]:
    """
    Return centre and diameter of an object's cross-section as floats [m].

    :raises GraspError: the centre is not two finite numbers, or the diameter not positive.
    """
    if _plain(center, diameter):
        return center, diameter
    x, y = finite_array(center, 2, "the object's centre [m]", GraspError)
    (size,) = finite_array([diameter], 1, "the object's diameter [m]", GraspError)
    if size <= 0.0:
        raise GraspError(f"the object's diameter {diameter!r} m: must be positive")
    if size < MIN_DIAMETER or max(size, abs(x), abs(y)) > MAX_DISTANCE:
        raise GraspError(
            f'the object of diameter {size:g} m at ({x:g}, {y:g}) m: must be '
            f'within {MAX_DISTANCE:g} m, and the diameter at least {MIN_DIAMETER:g} m'
        )
    return (float(x), float(y)), float(size)


def _plain(center: ArrayLike, diameter: float) -> bool:
    """Tell whether these are good floats already, as they are in every cycle of a servo."""
    return (
        type(center) is tuple
        and len(center) == 2
        and type(center[0]) is type(center[1]) is type(diameter) is float
        and -MAX_DISTANCE <= center[0] <= MAX_DISTANCE
        and -MAX_DISTANCE <= center[1] <= MAX_DISTANCE
        and MIN_DIAMETER <= diameter <= MAX_DISTANCE
    )


def pairs(vectors: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Turn vectors x + iy, (c,), into an array of x and y, (c, 2)."""
    return np.ascontiguousarray(vectors).view(np.float64).reshape(-1, 2)
