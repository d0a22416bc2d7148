# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tube of the paper's tests, with the stiffness of the package's default theory."""

from __future__ import annotations

from isotruss_ros.calibration.beam_fit import end_stiffness
from isotruss_ros.calibration.measurements import MODES
from isotruss_ros.core import load_robot
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.statics.tube_stiffness import tube_stiffness, TubeStiffness
import numpy as np
from numpy.typing import ArrayLike


def default_tube() -> TubeStiffness:
    """Return the stiffness model of the preset `triangle`."""
    return tube_stiffness(load_robot('triangle').description).model


def end_stiffnesses(pressure: ArrayLike, length: ArrayLike) -> dict[str, Array]:
    """
    Return the end stiffnesses of members in each mode, which are the diagonal of (2).

    :param pressure: gauge pressures [Pa], broadcast with the lengths.
    :param length: lengths of the members [m].
    :return: stiffnesses in the common shape of pressures and lengths [N/m]; rotary [N m/rad].
    """
    tube = default_tube()
    return {mode: end_stiffness(tube, mode, length, pressure) for mode in MODES}


def wrinkling_moment(pressure: float, radius: float) -> float:
    """
    Return the wrinkling moment p pi R^3 / 2 of a tube without axial force [N m].

    :param pressure: gauge pressure [Pa].
    :param radius: radius of the tube [m].
    """
    return 0.5 * np.pi * pressure * radius**3
