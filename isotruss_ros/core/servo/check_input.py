# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Check of the numbers of a servo's inputs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from isotruss_ros.core.errors import ArgumentError, GraspError, IsotrussError, quote
from isotruss_ros.core.inputs import Input, RejectedInput, StampedInput
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.model.convex_object import EXTERNAL_WRENCH
from isotruss_ros.core.model.obstacle import MAX_OBSTACLES, Obstacle
from isotruss_ros.core.numerics.argument_kinds import check_kind
from isotruss_ros.core.numerics.arrays import covariance_matrix, finite_array, MAX_LOAD
from isotruss_ros.core.statics.section import tube_pressures

#: Kind of the value of an input that is not a list of numbers.
VALUE_KINDS = {'rollers': 'RollerState', 'estimate': 'EstimatedTravel'}


def check_input(robot: Robot, name: str, given: Input) -> Input:
    """
    Return an input of a servo, or a rejection with the reason if its numbers are invalid.

    Time, twist, pose, external wrench, roller state and roller offsets must be finite numbers of
    the required count, and a covariance must be positive semidefinite; see `tube_pressures`.
    """
    if name == 'halt':
        _check_halt(given)
        return given
    if name == 'failed':
        return given
    if not isinstance(given, StampedInput):
        check_kind(name, given, 'StampedInput', 'RejectedInput', 'None')
        return given
    if name in VALUE_KINDS:
        check_kind(f'{name}.value', given.value, VALUE_KINDS[name])
    words, value = name.replace('_', ' '), given.value
    rollers = len(robot.roller_names)
    try:
        finite_array([given.time], 1, f'time of {words} [s]', GraspError)
        if name in ('twist', 'pose'):
            finite_array(value, 3, words, GraspError)
        elif name == 'wrench':
            finite_array(value, 3, EXTERNAL_WRENCH, GraspError, MAX_LOAD)
        elif name == 'obstacles':
            _check_obstacles(value)
        elif name == 'pressures':
            tube_pressures(robot.description, value)
        elif name == 'rollers':
            for field, numbers in value._asdict().items():
                if field == 'offsets' and isinstance(numbers, float):  # of all rollers
                    numbers = [numbers] * rollers
                finite_array(numbers, rollers, f'{field} of {words}', GraspError)
        elif name == 'estimate':
            finite_array(value.offsets, rollers, 'estimated roller offsets [m]', GraspError)
            what = 'covariance of roller offsets [m^2]'
            covariance_matrix(value.covariance, rollers, what, GraspError)
    except IsotrussError as error:
        return RejectedInput(str(error))
    return given


def _check_halt(given: Any) -> None:
    """Raise ArgumentError unless a halt of the client is None, or a status and its reason."""
    match given:
        case None | (Status(), str()):
            return
    raise ArgumentError(f'halt: {given!r}: must be None, or a status and its reason')


def _check_obstacles(obstacles: Sequence[Obstacle]) -> None:
    """Raise GraspError unless moving obstacles are few, with stamps and different names."""
    check_kind('obstacles', obstacles, 'Sequence[Obstacle]')
    if len(obstacles) > MAX_OBSTACLES:
        words = f'{len(obstacles)} moving obstacles; must be at most {MAX_OBSTACLES}'
        raise GraspError(words)
    names = [obstacle.name for obstacle in obstacles]
    for number, obstacle in enumerate(obstacles):
        words = f'moving obstacle {quote(obstacle.name)}'
        if obstacle.stamp is None:
            raise GraspError(f'{words}: has no stamp; must be the time of its pose [s]')
        finite_array([obstacle.stamp], 1, f'stamp of {words} [s]', GraspError)
        if obstacle.name in names[:number]:
            raise GraspError(f'{words}: is given twice; names must differ')
