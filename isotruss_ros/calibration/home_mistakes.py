# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Search for the mistake behind inconsistent joints: units, names, signs or tracker frame."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
import itertools
import math

from isotruss_ros.calibration.home_fit import fit_home, Posture
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Size of each unit that is often confused with the metre [m].
UNITS = {'mm': 1e-3, 'cm': 1e-2}


def find_mistake(robot: Robot, postures: Sequence[Posture], deviation: float) -> str:
    """
    Return a sentence with the mistake that best explains the joints; empty if none does.

    :param robot: robot of the robot file.
    :param postures: inconsistent postures.
    :param deviation: standard deviation of a measured coordinate [m].
    :return: sentence with the mistake and its correction.
    """
    squares = {}
    for text, corrected in _corrections(robot, postures):
        try:
            fit = fit_home(robot, corrected)
        except ConfigurationError:
            continue
        if _is_overdetermined(fit.jacobian) and fit.worst(deviation) is None:
            squares[text] = float((fit.residuals**2).sum())
    return (
        min(squares, key=squares.__getitem__)
        if squares
        else _moved_frame(robot, postures, deviation)
    )


def _is_overdetermined(jacobian: Array) -> bool:
    """Return whether a fit has more measured coordinates than unknowns, so that it can fail."""
    return jacobian.shape[0] > jacobian.shape[1]


def _corrections(robot: Robot, postures: Sequence[Posture]) -> Iterator[tuple[str, list[Posture]]]:
    """Yield possible mistakes as sentences, each with postures that are corrected for it."""
    for unit, size in UNITS.items():
        text = f'the markers are in {unit}: give them in m'
        yield text, [_scaled(posture, size) for posture in postures]
        text = f'the encoders read in {unit}: give roller positions in m'
        yield text, [_read(posture, size * posture.roller_positions) for posture in postures]
    measured = sorted({name for posture in postures for name in posture.joints})
    for one, other in itertools.combinations(measured, 2):
        names = {one: other, other: one}
        text = f'the names of the markers of joints {one} and {other} are swapped'
        yield text, [_with_names(posture, names) for posture in postures]
    rollers, numbers = robot.roller_names, np.arange(len(robot.roller_names))
    for i, j in itertools.combinations(numbers, 2):
        order = np.where(numbers == i, j, np.where(numbers == j, i, numbers))
        text = f'the names of the encoders of {rollers[i]} and {rollers[j]} are swapped'
        yield text, [_read(posture, posture.roller_positions[order]) for posture in postures]
    for i, name in enumerate(rollers):
        text = f'the encoder of {name} counts the other way: change its sign'
        signs = np.where(numbers == i, -1.0, 1.0)
        yield text, [_read(posture, signs * posture.roller_positions) for posture in postures]


def _scaled(posture: Posture, size: float) -> Posture:
    joints = {name: (size * x, size * y) for name, (x, y) in posture.joints.items()}
    return replace(posture, joints=joints)


def _read(posture: Posture, roller_positions: Array) -> Posture:
    return replace(posture, roller_positions=roller_positions)


def _with_names(posture: Posture, names: Mapping[str, str]) -> Posture:
    joints = {names.get(name, name): place for name, place in posture.joints.items()}
    return replace(posture, joints=joints)


def _moved_frame(robot: Robot, postures: Sequence[Posture], deviation: float) -> str:
    """Return a sentence about a moved tracker frame if this explains the residuals, or ''."""
    if 2 * sum(len(posture.joints) for posture in postures) < len(robot.roller_names) + 3:
        return ''
    try:
        fit = fit_home(robot, postures, moved=True)
    except ConfigurationError:
        return ''
    if not _is_overdetermined(fit.jacobian) or fit.worst(deviation) is not None:
        return ''
    x, y, angle = fit.motion
    x, y, degrees = (round(value, 3) + 0.0 for value in (x, y, math.degrees(angle)))
    return (
        f"the tracker's frame is not the robot's frame: in the robot's frame its origin is at ("
        f'{x:.3f}, {y:.3f}) m, turned by {degrees:.1f} degrees: publish this transform'
    )
