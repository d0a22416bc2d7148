# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Least-squares fit of roller offsets and of the tracker's frame to measured joint positions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.model.topology import check_names
from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np

#: Largest residual of a consistent joint, in standard deviations [-].
GATE_SIGMAS = 5.0
#: Largest number of iterations of a fit [-]; five to ten are usual from the home of the robot
#: file.
MAX_ITERATIONS = 100
#: Smallest ratio of a coordinate's residual to its error at which the error can be detected [-];
#: the ratio is sqrt(1 - leverage).
MIN_RESIDUAL_SHARE = 0.1


@dataclass(frozen=True)
class Posture:
    """Encoder readings and measured joint positions of a resting robot without an object."""

    roller_positions: Array  #: (r,) encoder readings [m]
    joints: Mapping[str, tuple[float, float]]  #: (x, y) by joint, robot frame [m]


class HomeFit(NamedTuple):
    """Roller offsets and tracker frame fitted by `fit_home`, with the residuals."""

    #: (r,) roller travel since the home of the robot file at which the encoders read zero [m]
    offsets: Array
    #: transform (dx, dy, angle) from the tracker's frame to the robot's frame [m, rad]
    motion: Array
    residuals: Array  #: (k, 2) measured minus fitted joint positions, posture after posture [m]
    jacobian: Array  #: (2k, p) Jacobian of the residuals

    @property
    def errors(self) -> tuple[Array, Array]:
        """
        Return the estimated errors of measured coordinates, and their fractions in the residuals.

        The fit adapts to an error, so only a fraction of the error appears in its residual.

        :return: errors (k, 2), |residual| / fraction [m]; and fractions (k, 2), sqrt(1 - leverage)
            [-].
        """
        basis = np.linalg.qr(self.jacobian)[0]
        left = np.sqrt(np.clip(1.0 - (basis**2).sum(axis=1), 1e-6, 1.0)).reshape(-1, 2)
        return np.abs(self.residuals) / left, left

    def worst(self, deviation: float) -> tuple[int, float] | None:
        """
        Return index and error [m] of the most inconsistent joint; None if all are consistent.

        :param deviation: standard deviation of a measured coordinate [m].
        """
        off, left = self.errors
        worst = int(off.max(axis=1).argmax())
        error = float(off[worst].max())
        fits = error <= GATE_SIGMAS * deviation or left[worst].max() <= MIN_RESIDUAL_SHARE
        return None if fits else (worst, error)


def fit_home(robot: Robot, postures: Sequence[Posture], moved: bool = False) -> HomeFit:
    """
    Fit the roller offsets to measured joints, with the Jacobian of (12).

    :param robot: robot of the robot file.
    :param postures: postures of the robot without object.
    :param moved: whether the transform from the tracker's frame to the robot's is fitted as well.
    :raises GraspError: a joint is unknown.
    :raises ConfigurationError: no configuration fits the joints.
    """
    joints = [_numbers(robot, posture) for posture in postures]
    count = len(robot.roller_names)
    measured = np.concatenate([_places(posture) for posture in postures])

    def shapes(unknowns: Array) -> list[Configuration]:
        return [robot.home.moved_to(each.roller_positions + unknowns[:count]) for each in postures]

    def misfit(unknowns: Array) -> Array:
        pairs = zip(shapes(unknowns), joints, strict=True)
        found = np.concatenate([shape.points[each] for shape, each in pairs])
        x, y, angle = unknowns[count:] if moved else np.zeros(3)
        return (complex(x, y) + np.exp(1j * angle) * measured - found).view(np.float64)

    def slope(unknowns: Array) -> Array:
        found = -_rates(shapes(unknowns), joints)
        if not moved:
            return found
        turned = 1j * np.exp(1j * unknowns[-1]) * measured
        by_motion = np.column_stack([np.ones_like(turned), np.full_like(turned, 1j), turned])
        return np.hstack([found, np.stack([by_motion.real, by_motion.imag], 1).reshape(-1, 3)])

    start = np.zeros(count + 3 * moved)
    from scipy import optimize

    found = optimize.least_squares(
        misfit, start, slope, method='lm', xtol=1e-12, max_nfev=MAX_ITERATIONS
    )
    return HomeFit(found.x[:count], found.x[count:], found.fun.reshape(-1, 2), found.jac)


def home_jacobian(robot: Robot, postures: Sequence[Posture]) -> Array:
    """
    Return the derivatives (2k, r) of joint positions with respect to roller offsets.

    The derivatives are evaluated at zero offsets.

    :param robot: robot of the robot file.
    :param postures: postures of the robot without object.
    :raises GraspError: a joint is unknown.
    :raises ConfigurationError: no configuration exists.
    """
    shapes = [robot.home.moved_to(each.roller_positions) for each in postures]
    return _rates(shapes, [_numbers(robot, posture) for posture in postures])


def _rates(shapes: Sequence[Configuration], joints: Sequence[Indices]) -> Array:
    """Return the derivatives (2k, r) of joint positions with respect to roller travel."""
    count = len(shapes[0].roller_positions)
    rows = [
        shape.node_jacobian.reshape(-1, 2, count)[each].reshape(-1, count)
        for shape, each in zip(shapes, joints, strict=True)
    ]
    return np.concatenate(rows)


def _places(posture: Posture) -> Array:
    """Return the measured joint positions x + iy [m]."""
    places = np.array(list(posture.joints.values()), dtype=float).reshape(-1, 2)
    return places @ np.array([1.0, 1.0j])


def _numbers(robot: Robot, posture: Posture) -> Indices:
    """Return the indices of the measured joints."""
    names = robot.topology.joint_names
    check_names('joint', posture.joints, names, robot.name)
    return np.array([names.index(name) for name in posture.joints], dtype=np.intp)
