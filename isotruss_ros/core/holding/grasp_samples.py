# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Check of the arguments of `settle_grasps`, each of which is one value or one for each grasp."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

from isotruss_ros.core.errors import GraspError, IsotrussError
from isotruss_ros.core.holding.held_grip import GraspInputs
from isotruss_ros.core.holding.settle_grasp import check_inputs, check_members
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.argument_kinds import check_kind
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.statics.section import Pressure
import numpy as np
from numpy.typing import ArrayLike

#: One value for all grasps, or one for each grasp.
Configurations: TypeAlias = 'Configuration | Sequence[Configuration]'
Objects: TypeAlias = 'ConvexObject | Sequence[ConvexObject]'
Pressures: TypeAlias = 'Pressure | Sequence[Mapping[str, float]]'


def check_grasps(
    configs: Configurations,
    bodies: Objects,
    friction: ArrayLike | None,
    external_wrench: ArrayLike,
    pressures: Pressures | None,
    members: Sequence[str] | None,
    poses: ArrayLike | None,
    stiffness: ArrayLike,
) -> tuple[list[GraspInputs], Array]:
    """Return the checked inputs of n grasps, and their coefficients of friction (n,)."""
    arguments: dict[str, list[Any]] = {
        'configs': [configs] if isinstance(configs, Configuration) else _listed(configs),
        'bodies': [bodies] if isinstance(bodies, ConvexObject) else _listed(bodies),
        'friction': _split(friction, 0),
        'external_wrench': _split(external_wrench, 1),
        'pressure': _split_pressures(pressures),
        'poses': [None] if poses is None else _listed(poses),
        'stiffness': _split(stiffness, 0),
    }
    counts = [len(values) for values in arguments.values() if len(values) != 1]
    count = max(counts, default=1)
    for name, values in arguments.items():
        if len(values) not in (1, count) or not values:
            raise GraspError(f'{name}: {len(values)} values: must be 1, or one for each grasp')
    for name, kind in (('configs', 'Configuration'), ('bodies', 'ConvexObject')):
        for i, value in enumerate(arguments[name]):
            check_kind(f'{name}[{i}]', value, kind)
    robot = arguments['configs'][0].robot
    _check_tubes(pressures, len(robot.description.pressures))
    for i, config in enumerate(arguments['configs']):
        if config.robot is not robot and config.robot != robot:
            raise GraspError(f'configs[{i}]: must be one of the robot {robot.name}, as configs[0]')
    indices = check_members(robot, members)
    radius = 0.5 * robot.description.tube_diameter
    arguments['bodies'] = [body.smoothed(radius) for body in arguments['bodies']]
    columns = [values * count if len(values) == 1 else values for values in arguments.values()]
    inputs, coefficients = [], []
    for i, row in enumerate(zip(*columns, strict=True)):
        config, body, mu, wrench, pressure, pose, factor = row
        try:
            placed = body if pose is None else body.placed_at(pose)
            checked = check_inputs(config, placed, mu, wrench, pressure, indices, factor)
        except IsotrussError as error:
            raise type(error)(f'grasp {i}: {error}') from error
        inputs.append(checked[0])
        coefficients.append(checked[1])
    return inputs, np.array(coefficients)


def _listed(values: Any) -> list[Any]:
    """Return values as a list; a value that has no entries is refused when it is checked."""
    return list(values) if np.iterable(values) else [values]


def _split(values: Any, dimensions: int) -> list[Any]:
    """Return the values of all grasps, each of so many dimensions, as a list."""
    is_one = values is None or np.iterable(values) == (dimensions > 0)
    if is_one and dimensions:  # a list of numbers, not of lists
        is_one = not any(map(np.iterable, values))
    return [values] if is_one else _listed(values)


def _check_tubes(pressures: Any, tubes: int) -> None:
    """Raise a `GraspError` unless a list of numbers has one pressure for each tube."""
    values = list(pressures) if np.iterable(pressures) else []
    if values and not any(map(np.iterable, values)) and len(values) != tubes:
        raise GraspError(
            f'pressure: {len(values)} values: must be one for each of the {tubes} tubes; '
            f'pressures of n grasps are an array (n, 1) or (n, {tubes})'
        )


def _split_pressures(pressures: Any) -> list[Any]:
    """Return the pressures of all grasps as a list, see `settle_grasps`."""
    if pressures is None or isinstance(pressures, Mapping) or not np.iterable(pressures):
        return [pressures]
    if any(isinstance(of_one, Mapping) for of_one in pressures):
        return list(pressures)
    rows = _split(pressures, 1)
    is_column = len(rows) > 1 and all(np.shape(row) == (1,) for row in rows)
    return [row[0] for row in rows] if is_column else rows
