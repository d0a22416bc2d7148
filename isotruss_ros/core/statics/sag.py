# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sag: displacements of the joints of an upright robot under its weight."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.statics.deform import deform
import numpy as np

#: An upright robot exceeds both bounds: fraction of the squared displacements that the weight
#: explains [-], and largest displacement of a joint [m]. A robot that lies flat exceeds both in
#: one of a hundred cases, if its roller offsets are 10 mm.
MIN_EXPLAINED_SHARE, MIN_SAG = 0.95, 5e-3


class Sag(NamedTuple):
    """Weight of each module, fitted to measured displacements of the joints."""

    weight: Array  #: (2,) weight of each module, robot frame [N]
    explained: float  #: share of the squared displacements that the weight explains [-]
    largest: float  #: largest displacement of a joint [m]

    def __str__(self) -> str:
        """Return a sentence with the fitted weight and the displacements."""
        x, y = self.weight.tolist()
        return (
            f'the joints hang by up to {1e3 * self.largest:.0f} mm as if each module weighed '
            f'({x:.1f}, {y:.1f}) N: the robot stands upright or on a slope, and gravity is not in '
            'the model: lay it flat'
        )

    @property
    def is_upright(self) -> bool:
        """Return whether weight explains the displacements, as it does in an upright robot."""
        return self.explained > MIN_EXPLAINED_SHARE and self.largest > MIN_SAG


def find_sag(config: Configuration, joints: Mapping[str, tuple[float, float]]) -> Sag | None:
    """
    Fit an equal weight of all modules to measured joints; None if too few are measured.

    :param joints: measured position (x, y) for the name of each joint, robot frame [m].
    """
    if 2 * len(joints) <= len(config.roller_positions):
        return None  # roller offsets alone can explain the displacements
    names = config.robot.topology.joint_names
    rows = [names.index(name) for name in joints]
    off = (np.array(list(joints.values())) - config.nodes[rows]).ravel()
    columns = []
    for direction in np.eye(2):
        loads = dict.fromkeys(config.robot.module_names, (*direction, 0.0))
        sagged = deform(config, {}, module_loads=loads, paper_model=True)
        columns.append(np.concatenate([sagged.displacement(name)[:2] for name in joints]))
    rates = np.column_stack(columns)
    weight, *_ = np.linalg.lstsq(rates, off, rcond=None)
    error = off - rates @ weight
    largest = float(np.hypot(*off.reshape(-1, 2).T).max())
    return Sag(weight, 1.0 - float(error @ error) / max(float(off @ off), 1e-18), largest)
