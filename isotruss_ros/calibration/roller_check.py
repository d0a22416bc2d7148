# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Check of a commanded roller: the roller that moved is identified from measured joints."""

from __future__ import annotations

from collections.abc import Mapping

from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.topology import check_names
from isotruss_ros.core.numerics.arrays import finite_array, finite_rows, MAX_MAGNITUDE
import numpy as np

#: Largest relative error of the measured travel of a roller without fault [-].
MAX_TRAVEL_ERROR = 0.2


def judge_roller(
    config: Configuration,
    roller: str,
    travel: float,
    moved: Mapping[str, tuple[float, float]],
    deviation: float,
) -> str:
    """
    Return a sentence with the fault of a commanded roller; empty without a fault.

    :param config: configuration at the middle of the motion.
    :param roller: name of the roller.
    :param travel: commanded travel [m].
    :param moved: displacement (dx, dy) for the name of each measured joint [m].
    :param deviation: standard deviation of a measured coordinate [m].
    :raises GraspError: a joint is unknown.
    :raises MeasurementError: no joint was measured, or a number is not finite.
    """
    what = 'displacements of joints (dx, dy) [m]'
    finite_rows(list(moved.values()), 2, what, MeasurementError, MAX_MAGNITUDE)
    what = 'travel and deviation [m]'
    finite_array([travel, deviation], 2, what, MeasurementError, MAX_MAGNITUDE)
    found, turned, rest = _identify_roller(config, moved)
    farthest = max(np.hypot(*each) for each in moved.values())
    if farthest < 5.0 * deviation:
        return f'no measured joint moves: {1e3 * farthest:.1g} mm'
    if found != roller:
        return f'{found} turned in its place, by {1e3 * turned:+.1f} mm'
    if rest > 5.0 * deviation + MAX_TRAVEL_ERROR * abs(travel):
        return f'no single roller explains the motion of the joints: residual {1e3 * rest:.0f} mm'
    if turned * travel < 0.0:
        return f'it turned the other way, by {1e3 * turned:+.1f} mm'
    if abs(turned - travel) > MAX_TRAVEL_ERROR * abs(travel):
        return f'it turned by {1e3 * turned:+.1f} mm in place of {1e3 * travel:+.1f} mm'
    return ''


def _identify_roller(
    config: Configuration, moved: Mapping[str, tuple[float, float]]
) -> tuple[str, float, float]:
    """
    Return the roller whose motion alone best explains the motion of the joints by (12).

    :return: name of the roller, its travel [m], and the root mean square residual of the
        displacements [m].
    """
    robot = config.robot
    names = robot.topology.joint_names
    if not moved:
        raise MeasurementError(f'no joint was measured: must be some of {", ".join(names)}')
    check_names('joint', moved, names, robot.name)
    places = [names.index(name) for name in moved]
    count = len(robot.roller_names)
    rows = config.node_jacobian.reshape(-1, 2, count)[places].reshape(-1, count)
    displaced = np.array(list(moved.values())).ravel()
    sizes = (rows**2).sum(axis=0)
    travels = np.divide(rows.T @ displaced, sizes, out=np.zeros(count), where=sizes > 0.0)
    left = displaced[:, None] - rows * travels
    best = int((left**2).sum(axis=0).argmin())
    rest = float(np.sqrt((left[:, best] ** 2).mean()))
    return robot.roller_names[best], float(travels[best]), rest
