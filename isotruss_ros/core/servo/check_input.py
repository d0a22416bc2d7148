# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Check of the inputs of a servo."""

from __future__ import annotations

from isotruss_ros.core.errors import GraspError, IsotrussError
from isotruss_ros.core.inputs import Input, RejectedInput, StampedInput
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.model.convex_object import EXTERNAL_WRENCH
from isotruss_ros.core.numerics.arrays import covariance_matrix, finite_array, load_array
from isotruss_ros.core.statics.section import tube_pressures
import numpy as np


def check_input(robot: Robot, name: str, given: Input) -> Input:
    """
    Return an input of a servo, or a rejection with the reason if its numbers are invalid.

    Time, twist, pose, external wrench, roller state and roller offsets must be finite numbers of
    the required count, and a covariance must be positive semidefinite; see `tube_pressures`.
    """
    if not isinstance(given, StampedInput):
        return given
    try:
        _check_numbers(robot, name, given)
    except IsotrussError as error:
        return RejectedInput(str(error))
    return given


def _check_numbers(robot: Robot, name: str, given: StampedInput) -> None:
    """Raise IsotrussError if numbers of an input are invalid."""
    words, count, value = name.replace('_', ' '), len(robot.roller_names), given.value
    finite_array([given.time], 1, f'time of {words} [s]', GraspError)
    if name in ('twist', 'pose'):
        finite_array(value, 3, words, GraspError)
    elif name == 'wrench':
        load_array(value, 3, EXTERNAL_WRENCH, GraspError)
    elif name == 'pressures':
        tube_pressures(robot.description, value)
    elif name == 'rollers':
        parts = value if np.ndim(value.offsets) else value[:2]
        for field, numbers in zip(value._fields, parts, strict=False):
            finite_array(numbers, count, f'{field} of {words}', GraspError)
    elif name == 'estimate':
        finite_array(value.offsets, count, 'estimated roller offsets [m]', GraspError)
        covariance_matrix(
            value.covariance, count, 'covariance of roller offsets [m^2]', GraspError
        )
