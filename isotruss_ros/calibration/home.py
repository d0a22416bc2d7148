# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calibration of roller offsets from measured joint positions of a robot without an object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
import math

from isotruss_ros.calibration.home_fit import fit_home, home_jacobian, HomeFit, Posture
from isotruss_ros.calibration.home_mistakes import find_mistake
from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.model.description import RobotDescription
from isotruss_ros.core.model.topology import check_names
from isotruss_ros.core.numerics.arrays import Array, finite_rows, MAX_MAGNITUDE
from isotruss_ros.core.numerics.records import Record
import numpy as np

#: Smallest number of measured joint positions [-].
MIN_JOINTS = 3
#: Smallest singular value, relative to the largest, at which a combination of offsets counts as
#: determined [-].
MIN_SINGULAR_RATIO = 1e-2


@dataclass(frozen=True, eq=False, repr=False)
class HomeCalibration(Record, headline=('offsets', 'deviations', 'residuals')):
    """Fitted roller offsets, and the robot's description with the corrected home."""

    #: (r,) roller travel since the home of the robot file at which the encoders read zero [m]
    offsets: Array
    deviations: Array  #: (r,) standard deviations of `offsets` [m]
    residuals: Array  #: (k, 2) measured minus fitted joint positions, posture after posture [m]
    description: RobotDescription  #: the robot with the fitted home, where the encoders read zero


def calibrate_home(
    robot: Robot, postures: Sequence[Posture], deviation: float = 1e-3
) -> HomeCalibration:
    """
    Fit the roller offsets by least squares over all postures.

    The Jacobian follows from (12). No prior of the offsets is used.

    :param robot: robot of the robot file.
    :param postures: measured postures of the robot without object and without external loads.
    :param deviation: standard deviation of a measured coordinate, positive [m]. If the residuals
        scatter more, `HomeCalibration.deviations` is computed from their standard deviation
        instead.
    :raises GraspError: a joint is unknown.
    :raises MeasurementError: too few joints were measured, the joints do not determine the
        offsets, or a joint is inconsistent with the others; the message names the joint.
    """
    joints = [place for posture in postures for place in posture.joints.values()]
    finite_rows(joints, 2, 'measured joints (x, y) [m]', MeasurementError, MAX_MAGNITUDE)
    measured = {name for posture in postures for name in posture.joints}
    check_names('joint', measured, robot.topology.joint_names, robot.name)
    if len(measured) < MIN_JOINTS:
        raise MeasurementError(
            f'joints {", ".join(sorted(measured)) or "none"}: must be {MIN_JOINTS} or more'
        )
    if not 0.0 < deviation < math.inf:
        raise MeasurementError(f'deviation {deviation!r} m: must be a positive number')
    try:
        jacobian = home_jacobian(robot, postures)
        _require_determined(robot, sorted(measured), jacobian)
        fit = fit_home(robot, postures)
    except ConfigurationError as error:
        text = f'the joints fit no shape of the robot: {error}'
        raise MeasurementError(find_mistake(robot, postures, deviation) or text) from error
    _refuse_misfit(robot, postures, fit, deviation)
    errors = fit.residuals.ravel()
    free = len(errors) - len(fit.offsets)
    scatter = float(np.sqrt(errors @ errors / free)) if free else 0.0
    spread = np.linalg.inv(fit.jacobian.T @ fit.jacobian)
    return HomeCalibration(
        fit.offsets,
        max(deviation, scatter) * np.sqrt(np.diag(spread)),
        fit.residuals,
        move_home(robot, fit.offsets),
    )


def _require_determined(robot: Robot, measured: Sequence[str], jacobian: Array) -> None:
    """Raise MeasurementError if joints do not determine the offsets, naming joints that would."""
    values, modes = np.linalg.svd(jacobian)[1:]
    if len(values) == jacobian.shape[1] and values[-1] >= MIN_SINGULAR_RATIO * values[0]:
        return
    nodes = (robot.home.node_jacobian @ modes[-1]).reshape(-1, 2)
    names = robot.topology.joint_names
    most = names[int(np.hypot.reduce(nodes[: len(names)], axis=1).argmax())]
    raise MeasurementError(
        f'joints {", ".join(measured)}: they do not determine all roller offsets; measure joint '
        f'{most} as well, or more postures'
    )


def _refuse_misfit(
    robot: Robot, postures: Sequence[Posture], fit: HomeFit, deviation: float
) -> None:
    """Raise MeasurementError if the residual of a joint far exceeds the measurement noise."""
    worst = fit.worst(deviation)
    if worst is None:
        return
    names = [(number, name) for number, posture in enumerate(postures) for name in posture.joints]
    (number, name), off = names[worst[0]], worst[1]
    raise MeasurementError(
        find_mistake(robot, postures, deviation)
        or f'joint {name} of posture {number + 1}: {1e3 * off:.0f} mm off the fit of the others, '
        f'measured to {1e3 * deviation:.1g} mm; check this marker and its name'
    )


def move_home(robot: Robot, travel: Array) -> RobotDescription:
    """
    Return the description of a robot with another configuration as home.

    :param robot: the robot.
    :param travel: (r,) roller travel from the present home to the other [m].
    :raises ConfigurationError: no configuration exists at this travel.
    """
    nodes = robot.home.moved_to(travel).nodes
    names = robot.topology.joint_names
    joints = {name: tuple(nodes[number].tolist()) for number, name in enumerate(names)}
    return replace(robot.description, joints=joints)
