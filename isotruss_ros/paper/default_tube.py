"""The tube of the paper's tests, with the theory that is the package's default."""

from __future__ import annotations

from isotruss_ros.core import load_robot
from isotruss_ros.core.beam import local_stiffness
from isotruss_ros.core.tube_stiffness import tube_stiffness, TubeStiffness
from isotruss_ros.fit.measurements import MODES
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def default_tube() -> TubeStiffness:
    """Return the stiffness model of the preset `triangle`."""
    return tube_stiffness(load_robot('triangle').description)


def end_stiffnesses(pressure: ArrayLike, length: ArrayLike) -> dict[str, Array]:
    """
    Return the end stiffnesses of members by mode: the diagonal of (2).

    :param pressure: gauge [Pa]; broadcast with the lengths.
    :param length: [m].
    :return: arrays of their common shape [N/m], rotary [N m/rad].
    """
    pressure, length = np.broadcast_arrays(pressure, length)
    rigidities = default_tube().rigidities(length.ravel(), pressure.ravel())
    matrices = local_stiffness(length.ravel(), *rigidities)
    return {
        mode: matrices[:, place, place].reshape(length.shape) for place, mode in enumerate(MODES)
    }
