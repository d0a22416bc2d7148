# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
When an inflated tube gives way: theory of thin membranes that carry no compression.

Under gauge pressure p and an axial force N (compression) the wall carries the pull
T = p pi r^2 - N in all. A bending moment M makes one side slack at M = T r / 2, where the wall
begins to wrinkle; for N = 0 this is M_w = p pi r^3 / 2. At twice that, M = T r, all of the pull is
in the outermost fibre and the tube folds. See Comer and Levy, AIAA Journal 1 (1963) 1652-1655;
with axial force Davids and Zhang, Engineering Structures 30 (2008) 1969-1980.

As a column between two hinges an inflated tube buckles at N_c = N_e / (1 + N_e / GA) with
N_e = pi^2 EI / L^2 (Fichter, NASA TN D-3466, 1966; its GA includes the pressure's part). Before,
compression makes moments grow by 1 / (1 - N / N_c).
"""

from __future__ import annotations

from isotruss_ros.core.numerics.arrays import Array
import numpy as np
from numpy.typing import ArrayLike

#: The tube begins to wrinkle at this many times T r / 2, and folds at that many.
ONSET, COLLAPSE = 1.0, 2.0


def pressure_force(pressure: float, radius: float) -> float:
    """
    Return p pi r^2 [N].

    :param pressure: p, gauge [Pa].
    :param radius: r of the tube [m].
    """
    return pressure * np.pi * radius**2


def wrinkling_moment(pressure: float, radius: float) -> float:
    """
    Return M_w = p pi r^3 / 2 of a tube without axial force [N m].

    :param pressure: p, gauge [Pa].
    :param radius: r of the tube [m].
    """
    return 0.5 * radius * pressure_force(pressure, radius)


def column_load(flexural: ArrayLike, shear: ArrayLike, length: ArrayLike) -> Array:
    """
    Return the compression at which a hinged tube buckles as a whole [N].

    :param flexural: EI [N m^2].
    :param shear: GA [N].
    :param length: hinge to hinge [m].
    """
    euler = np.pi**2 * np.asarray(flexural) / np.asarray(length) ** 2
    return euler / (1.0 + euler / np.asarray(shear))


def load_factor(
    moment: ArrayLike,
    compression: ArrayLike,
    column: ArrayLike,
    pull: float,
    radius: float,
    stage: float = ONSET,
) -> Array:
    """
    Return how many times the loads of a linear analysis a tube bears.

    The smallest t with t M / (1 - t N / N_c) = stage (pull - t N) r / 2.

    :param moment: M, largest in the tube, not negative [N m].
    :param compression: N, not negative [N].
    :param column: N_c, infinite for no growth of moments [N].
    :param pull: p pi r^2 [N].
    :param radius: r of the tube [m].
    :param stage: ONSET or COLLAPSE.
    """
    moment, compression = np.asarray(moment, dtype=float), np.asarray(compression, dtype=float)
    lever = 0.5 * stage * radius
    # (1 - t N / N_c) (pull - t N) lever - t M = 0; the first root is below N_c / N and pull / N.
    square = lever * compression**2 / np.asarray(column, dtype=float)
    line = lever * compression * (1.0 + pull / np.asarray(column, dtype=float)) + moment
    root = np.sqrt(line**2 - 4.0 * square * lever * pull)
    return 2.0 * lever * pull / (line + root)
