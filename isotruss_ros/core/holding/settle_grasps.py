# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Equilibria of many free objects at once: `settle_grasps`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
import itertools
from typing import NamedTuple

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.holding.grasp_samples import (
    check_grasps,
    Configurations,
    Objects,
    Pressures,
)
from isotruss_ros.core.holding.held_grip import GraspInputs, HoldStatus
from isotruss_ros.core.holding.settle_grasp import settle_inputs
from isotruss_ros.core.holding.settled_grasps import SettledGrasps
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.blas_threads import single_threaded
import numpy as np
from numpy.typing import ArrayLike

#: Number of grasps that are computed together [-]. It bounds the memory.
GROUP_SIZE = 128


@single_threaded
def settle_grasps(
    configs: Configurations,
    bodies: Objects,
    friction: ArrayLike | None = None,
    external_wrenches: ArrayLike = (0.0, 0.0, 0.0),
    pressures: Pressures | None = None,
    members: Sequence[str] | None = None,
    *,
    poses: ArrayLike | None = None,
    stiffness: ArrayLike = 1.0,
    executor: Executor | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> SettledGrasps:
    """
    Return the equilibria of n grasped objects near their measured poses, as arrays.

    The equilibria are those of `settle_grasp`. Each argument is one value for all grasps, or n
    values. One grasp of many takes a fraction of the time of a call of `settle_grasp`.

    :param configs: configuration of the robot, or n configurations of the same robot.
    :param bodies: the object at its measured pose, or n objects.
    :param friction: coefficient of friction between tube and object, or (n,) coefficients; None:
        the coefficient of each object, or 0.5 if it has none.
    :param external_wrenches: (fx, fy, m) on the object about the origin of its frame, or an array
        (n, 3) [N, N m].
    :param pressures: gauge pressure [Pa], see `tube_pressures`; or an array (n, t) for t tubes, an
        array (n, 1) of the pressures in all tubes, or a list of n mappings from names of tubes to
        pressures; None: the pressures of the robot file.
    :param members: names `t/j-k` of the two or three members that grasp all objects; None: for
        each object the members that it overlaps, or if it overlaps fewer than two, the two
        nearest.
    :param poses: (n, 3) measured poses (x, y, angle) of the objects [m, rad]; None: the poses of
        `bodies`.
    :param stiffness: factor on EA, EI and GA of the tubes, or (n,) factors [-].
    :param executor: executor that computes groups of `GROUP_SIZE` grasps, for example a process
        pool or that of a Dask client; None: this process computes them.
    :param on_progress: function that is called with the completed fraction, 0 to 1.
    :raises GraspError: an argument is invalid, or the arguments have different numbers of values;
        the message names the grasp.
    :raises StructureError: a pressure is invalid; the message names the grasp.
    """
    inputs, coefficients = check_grasps(
        configs, bodies, friction, external_wrenches, pressures, members, poses, stiffness
    )
    count = len(inputs)
    groups = [
        (inputs[begin : begin + GROUP_SIZE], coefficients[begin : begin + GROUP_SIZE])
        for begin in range(0, count, GROUP_SIZE)
    ]
    compute = map if executor is None else executor.map
    parts: list[_GroupResult] = []
    for part in compute(_settle_group, *zip(*groups, strict=True)):
        parts.append(part)
        if on_progress is not None:
            on_progress(min(len(parts) * GROUP_SIZE / count, 1.0))
    values = np.concatenate([part.values for part in parts])
    names = inputs[0].config.robot.member_names
    # Axes: quantity, member, grasp.
    of_members = values[:, 9:].T.reshape(3, len(names), count)
    normal, friction_forces, used = (dict(zip(names, rows, strict=True)) for rows in of_members)
    return SettledGrasps(
        hold=tuple(itertools.chain(*(part.hold for part in parts))),
        reason=tuple(itertools.chain(*(part.reason for part in parts))),
        friction=coefficients,
        slip_margin=values[:, 0],
        squeeze=values[:, 1],
        required_friction=values[:, 2],
        pose=values[:, 3:6],
        displacement=values[:, 6:9],
        normal_forces=normal,
        friction_forces=friction_forces,
        utilisation=used,
        inputs=inputs,
    )


class _GroupResult(NamedTuple):
    """Values of `SettledGrasps` for a group of n grasps by m members."""

    hold: tuple[HoldStatus | None, ...]
    reason: tuple[str, ...]
    #: (n, 9 + 3 m) slip margin, squeeze, required friction, pose, displacement; then normal
    #: forces, friction forces and utilisation of the members
    values: Array


def _settle_group(inputs: Sequence[GraspInputs], friction: Array) -> _GroupResult:
    """Return the values of settled grasps, each with its inputs and coefficient of friction."""
    names = inputs[0].config.robot.member_names
    hold: list[HoldStatus | None] = []
    reason: list[str] = []
    values = np.full((len(inputs), 9 + 3 * len(names)), np.nan)
    for i, (given, coefficient) in enumerate(zip(inputs, friction.tolist(), strict=True)):
        try:
            settled = settle_inputs(given, coefficient)
        except StructureError as error:
            hold.append(None)
            reason.append(str(error))
            continue
        hold.append(settled.hold)
        reason.append(settled.reason)
        squeeze = 0.0 if settled.equilibrium is None else settled.equilibrium.squeeze
        values[i, :3] = settled.slip_margin, squeeze, settled.required_friction
        values[i, 3:6], values[i, 6:9] = settled.pose, settled.displacement
        of_members = settled.normal_forces, settled.friction_forces, settled.utilisation
        values[i, 9:] = [found.get(name, 0.0) for found in of_members for name in names]
    return _GroupResult(tuple(hold), tuple(reason), values)
