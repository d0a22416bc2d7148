# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calibration of the tube stiffness from known forces on joints of a robot without an object."""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import NamedTuple

from isotruss_ros.calibration.home_fit import GATE_SIGMAS
from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.robot_schema import plausible_range
from isotruss_ros.core.numerics.arrays import finite_rows, MAX_MAGNITUDE
from isotruss_ros.core.statics.deform import deform
import numpy as np

#: Largest relative standard deviation of a valid scale [-].
MAX_RELATIVE_DEVIATION = 0.3
#: Number of fixed-point iterations [-]. Each iteration reduces the error to a twentieth or less,
#: unless tubes wrinkle.
ITERATIONS = 5
#: Largest valid force on a joint [N].
MAX_PULL = 1e6


class StiffnessCalibration(NamedTuple):
    """Calibrated factor on the stiffness of all tubes."""

    #: ratio of the measured stiffness to that of the robot file without its `tube.stiffness_scale`
    #: [-]
    scale: float
    deviation: float  #: standard deviation of the scale [-]


def calibrate_stiffness(
    config: Configuration,
    pull: Mapping[str, tuple[float, float]],
    before: Mapping[str, tuple[float, float]],
    under: Mapping[str, tuple[float, float]],
    deviation: float = 1e-3,
) -> StiffnessCalibration:
    """
    Fit a stiffness factor to the displacements of joints under known forces.

    The fit is by least squares. A robot that is softer than its model by a factor deforms like the
    model under a load that is larger by this factor. The robot must hold no object: with an
    object, a common factor on stiffness and contact forces does not change the displacements, so
    displacements do not determine it.

    :param config: configuration of the robot, with the rollers at rest.
    :param pull: force (fx, fy) for the name of each loaded joint, robot frame [N].
    :param before: position (x, y) without these forces for the name of each joint [m].
    :param under: position (x, y) under these forces for the name of the same joints [m].
    :param deviation: standard deviation of a measured coordinate, positive [m].
    :raises MeasurementError: the joints differ, a joint is inconsistent, or the displacements are
        too small; the message names the requirement.
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
    there = finite_rows(places, 2, what, MeasurementError, MAX_MAGNITUDE).reshape(2, -1, 2)
    moved = there[0] - there[1]
    finite_rows(list(pull.values()), 2, 'pull (fx, fy) [N]', MeasurementError, MAX_PULL)
    if not 0.0 < deviation < math.inf:
        raise MeasurementError(f'deviation {deviation!r} m: must be a positive number')
    for _ in range(ITERATIONS):
        # A softer robot deforms like this one under a larger load.
        loaded = deform(config, {joint: give * np.asarray(pull[joint]) for joint in pull})
        model = np.array([loaded.displacement(name)[:2] for name in names]) / give
        size = float((model**2).sum())
        give = float((model * moved).sum()) / size if size > 0.0 else 0.0
        if not give > 0.0:
            break
    # A displacement is the difference of two measured positions.
    spread = math.sqrt(2.0) * deviation
    if not give > 0.0 or spread / math.sqrt(size) > MAX_RELATIVE_DEVIATION * give:
        raise MeasurementError(
            f'the joints move by {1e3 * np.hypot.reduce(moved, axis=1).max():.2g} mm where the '
            f'model has {1e3 * np.hypot.reduce(model, axis=1).max():.2g} mm, measured to '
            f'{1e3 * deviation:.2g} mm: the displacement is too small; pull harder, or measure '
            'for longer'
        )
    off = np.hypot.reduce(moved - give * model, axis=1)
    if off.max() > GATE_SIGMAS * spread:
        worst = int(off.argmax())
        raise MeasurementError(
            f'joint {names[worst]}: moved {1e3 * off[worst]:.2g} mm off what one scale explains, '
            f'measured to {1e3 * deviation:.2g} mm; check the pull, and that no roller turned'
        )
    scale = config.robot.description.stiffness_scale / give
    low, high = plausible_range('tube.stiffness_scale')
    if not low <= scale <= high:
        raise MeasurementError(
            f'stiffness {scale:.3g} times that of the model: must be from {low:g} to {high:g}; is '
            'the pull in N, and are positions in m?'
        )
    return StiffnessCalibration(scale, scale * spread / (give * math.sqrt(size)))
