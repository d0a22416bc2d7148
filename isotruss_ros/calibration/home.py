# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where the rollers' zeros are, from measured joints of the empty robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.solve_joint_velocity import check_joint
from isotruss_ros.core.model.description import RobotDescription
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.records import Record
import numpy as np
import scipy

#: Fewer measured joints are not relied on.
FEWEST_JOINTS = 3
#: A joint that is off the fit by more than so many standard deviations does not fit.
GATE = 5.0
#: A combination of zeros that moves the joints so much less than another one is not determined.
INDIFFERENT = 1e-2


@dataclass(frozen=True)
class Posture:
    """Where joints of the empty robot were measured at one reading of the encoders."""

    roller_positions: Array  #: (r,) readings [m]
    joints: Mapping[str, tuple[float, float]]  #: (x, y) by the name of the joint, robot frame [m]


@dataclass(frozen=True, eq=False, repr=False)
class HomeCalibration(Record, headline=('zeros', 'deviations', 'residuals')):
    """Zeros of the rollers, and the robot whose home is where the encoders read zero."""

    zeros: Array  #: (r,) travel since the home of the robot file where encoders read zero [m]
    deviations: Array  #: (r,) their standard deviations [m]
    residuals: Array  #: (k, 2) measured minus fitted joints, posture after posture [m]
    description: RobotDescription  #: of the robot, with the home that was found


def calibrate_home(
    robot: Robot, postures: Sequence[Posture], deviation: float = 1e-3
) -> HomeCalibration:
    """
    Find the zeros of the rollers by least squares over all postures.

    The Jacobian is that of (12). Zeros are found from the measured joints alone: no prior.

    :param robot: as its file has it.
    :param postures: of the empty robot, whose joints no load moves.
    :param deviation: standard deviation of a measured coordinate, positive [m]; where the joints
        scatter more, the deviations follow from that.
    :raises GraspError: a joint is unknown.
    :raises MeasurementError: there are too few joints, they do not determine the zeros, or one of
        them does not fit; names it.
    """
    joints = [_numbers(robot, posture) for posture in postures]
    measured = np.concatenate(
        [np.array(list(posture.joints.values()), dtype=float) for posture in postures]
    )
    known = {name for posture in postures for name in posture.joints}
    if len(known) < FEWEST_JOINTS:
        raise MeasurementError(
            f'joints {", ".join(sorted(known)) or "none"}: must be {FEWEST_JOINTS} or more'
        )
    if not np.isfinite(measured).all() or not deviation > 0.0:
        raise MeasurementError('measured joints and their deviation: must be finite, in metres')

    def misfit(zeros: Array) -> Array:
        shapes = [robot.home.moved_to(each.roller_positions + zeros) for each in postures]
        found = [shape.nodes[each] for shape, each in zip(shapes, joints, strict=True)]
        return (measured - np.concatenate(found)).ravel()

    def slope(zeros: Array) -> Array:
        shapes = [robot.home.moved_to(each.roller_positions + zeros) for each in postures]
        rows = [
            shape.node_jacobian.reshape(-1, 2, len(zeros))[each].reshape(-1, len(zeros))
            for shape, each in zip(shapes, joints, strict=True)
        ]
        return -np.concatenate(rows)

    _require_determined(robot, sorted(known), slope(np.zeros(len(robot.roller_names))))
    try:
        found = scipy.optimize.least_squares(
            misfit, np.zeros(len(robot.roller_names)), slope, method='lm', xtol=1e-12
        )
    except ConfigurationError as error:
        raise MeasurementError(f'the joints fit no shape of the robot: {error}') from error
    residuals = found.fun.reshape(-1, 2)
    _refuse_misfit(postures, residuals, found.jac, deviation)
    free = len(found.fun) - len(found.x)
    scatter = float(np.sqrt(found.fun @ found.fun / free)) if free else 0.0
    spread = np.linalg.inv(found.jac.T @ found.jac)
    return HomeCalibration(
        found.x,
        max(deviation, scatter) * np.sqrt(np.diag(spread)),
        residuals,
        move_home(robot, found.x),
    )


def _numbers(robot: Robot, posture: Posture) -> Indices:
    """Return the numbers of the measured joints."""
    for name in posture.joints:
        check_joint(robot, name)
    names = robot.topology.joint_names
    return np.array([names.index(name) for name in posture.joints], dtype=np.intp)


def _require_determined(robot: Robot, known: Sequence[str], jacobian: Array) -> None:
    """Refuse joints that leave a combination of zeros undetermined; name joints that would not."""
    values, modes = np.linalg.svd(jacobian)[1:]
    if len(values) == jacobian.shape[1] and values[-1] >= INDIFFERENT * values[0]:
        return
    nodes = (robot.home.node_jacobian @ modes[-1]).reshape(-1, 2)
    names = robot.topology.joint_names
    most = names[int(np.hypot.reduce(nodes[: len(names)], axis=1).argmax())]
    raise MeasurementError(
        f'joints {", ".join(known)}: they do not determine all zeros; measure joint {most} as '
        'well, or more postures'
    )


def _refuse_misfit(
    postures: Sequence[Posture], residuals: Array, jacobian: Array, deviation: float
) -> None:
    """Refuse a joint that is off the fit by much more than it is measured to."""
    names = [(number, name) for number, each in enumerate(postures) for name in each.joints]
    q = np.linalg.qr(jacobian)[0]
    # What is left of an error of one coordinate after the fit: 1 minus its leverage.
    left = np.sqrt(np.clip(1.0 - (q**2).sum(axis=1), 1e-6, 1.0)).reshape(-1, 2)
    off = np.abs(residuals) / left
    worst = int(off.max(axis=1).argmax())
    if off[worst].max() > GATE * deviation and left[worst].max() > 0.1:
        number, name = names[worst]
        raise MeasurementError(
            f'joint {name} of posture {number + 1}: {1e3 * off[worst].max():.0f} mm off the fit '
            f'of the others, measured to {1e3 * deviation:.1g} mm; check this marker and its name'
        )


def move_home(robot: Robot, zeros: Array) -> RobotDescription:
    """
    Return the description of the same robot with another home.

    :param robot: the robot.
    :param zeros: (r,) roller travel since its home at which the other one is [m].
    :raises ConfigurationError: there is no such shape.
    """
    nodes = robot.home.moved_to(zeros).nodes
    names = robot.topology.joint_names
    joints = {name: tuple(nodes[number].tolist()) for number, name in enumerate(names)}
    return replace(robot.description, joints=joints)
