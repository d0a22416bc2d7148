# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How stiff the tubes are against the model, from a known pull at the empty robot."""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import NamedTuple

from isotruss_ros.calibration.home_fit import GATE
from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.pose import MAX_DISTANCE
from isotruss_ros.core.numerics.arrays import finite_rows
from isotruss_ros.core.statics.deform import deform
import numpy as np

#: A scale that is less sure than this share of itself is none.
LARGEST_SHARE = 0.3
#: Each leaves a twentieth of the error of the scale at most, of pulls that leave tubes unwrinkled.
PASSES = 5
#: Larger pulls are none of this world [N].
MOST_PULL = 1e6


class StiffnessCalibration(NamedTuple):
    """One factor on the stiffness of all tubes."""

    scale: float  #: against the robot file without its `tube.stiffness_scale` [-]
    deviation: float  #: its standard deviation [-]


def calibrate_stiffness(
    config: Configuration,
    pull: Mapping[str, tuple[float, float]],
    before: Mapping[str, tuple[float, float]],
    under: Mapping[str, tuple[float, float]],
    deviation: float = 1e-3,
) -> StiffnessCalibration:
    """
    Fit one scale to the displacements of joints under a known pull (least squares).

    A robot that is softer by a factor bends as its model does under so much more load. No geometry
    of a held object tells the scale: loads, stiffness and forces times any factor move nothing. So
    the robot is empty.

    :param config: where the robot is; its rollers do not turn.
    :param pull: (fx, fy) by joint, robot frame [N].
    :param before: (x, y) of joints without the pull, by name [m].
    :param under: of the same joints under it [m].
    :param deviation: standard deviation of a measured coordinate, positive [m].
    :raises MeasurementError: the joints are not the same, one does not fit, or they move too
        little to tell; says what would be right.
    :raises StructureError: see `deform`.
    """
    if not before or set(before) != set(under):
        raise MeasurementError(
            f'joints {", ".join(sorted(under)) or "none"} under the pull, '
            f'{", ".join(sorted(before)) or "none"} before: must be the same'
        )
    names, give = list(before), 1.0
    places = [joints[name] for joints in (under, before) for name in names]
    what = 'places of joints (x, y) [m]'
    there = finite_rows(places, 2, what, MeasurementError, MAX_DISTANCE).reshape(2, -1, 2)
    moved = there[0] - there[1]
    finite_rows(list(pull.values()), 2, 'pull (fx, fy) [N]', MeasurementError, MOST_PULL)
    if not 0.0 < deviation < math.inf:
        raise MeasurementError(f'deviation {deviation!r} m: must be a positive number')
    for _ in range(PASSES):
        # A robot that gives more bends as this one does under more load.
        loaded = deform(config, {joint: give * np.asarray(pull[joint]) for joint in pull})
        model = np.array([loaded.displacement(name)[:2] for name in names]) / give
        size = float((model**2).sum())
        give = float((model * moved).sum()) / size if size > 0.0 else 0.0
        if not give > 0.0:
            break
    # A displacement is a difference of two measured places.
    spread = math.sqrt(2.0) * deviation
    if not give > 0.0 or spread / math.sqrt(size) > LARGEST_SHARE * give:
        raise MeasurementError(
            f'the joints move by {1e3 * np.hypot.reduce(moved, axis=1).max():.2g} mm where the '
            f'model has {1e3 * np.hypot.reduce(model, axis=1).max():.2g} mm, measured to '
            f'{1e3 * deviation:.2g} mm: too little to tell; pull harder, or measure for longer'
        )
    off = np.hypot.reduce(moved - give * model, axis=1)
    if off.max() > GATE * spread:
        worst = int(off.argmax())
        raise MeasurementError(
            f'joint {names[worst]}: moved {1e3 * off[worst]:.2g} mm off what one scale explains, '
            f'measured to {1e3 * deviation:.2g} mm; check the pull, and that no roller turned'
        )
    scale = config.robot.description.stiffness_scale / give
    return StiffnessCalibration(scale, scale * spread / (give * math.sqrt(size)))
