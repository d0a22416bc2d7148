"""Check numbers that callers hand over."""

from __future__ import annotations

from isotruss_ros.core.errors import IsotrussError
import numpy as np
from numpy.typing import ArrayLike, NDArray


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
