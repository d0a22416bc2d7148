# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Equilibria of many free objects at once: `settle_grasps`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
import itertools
from typing import NamedTuple

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.holding.attach_grip import attach_grips
from isotruss_ros.core.holding.grasp_samples import (
    check_grasps,
    Configurations,
    Objects,
    Pressures,
)
from isotruss_ros.core.holding.grip_response import find_slip_planes
from isotruss_ros.core.holding.held_grip import (
    Equilibria,
    GraspInputs,
    HeldGrip,
    HoldStatus,
    NotHeldError,
)
from isotruss_ros.core.holding.settle_grasp import judge, lose_grasp
from isotruss_ros.core.holding.settled_grasp import LostContact, SettledGrasp
from isotruss_ros.core.holding.settled_grasps import SettledGrasps
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.blas_threads import single_threaded
import numpy as np
from numpy.typing import ArrayLike

#: Number of grasps that are computed together [-]. It bounds the memory; with half of it, a grasp
#: of many takes 8 to 12 % more time, because calls of small operations take most of it.
GROUP_SIZE = 256


@check_kinds
@single_threaded
def settle_grasps(
    configs: Configurations,
    bodies: Objects,
    friction: ArrayLike | None = None,
    external_wrench: ArrayLike = (0.0, 0.0, 0.0),
    pressure: Pressures | None = None,
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
    :param external_wrench: (fx, fy, m) on the object about the origin of its frame, or an array
        (n, 3) [N, N m].
    :param pressure: gauge pressure [Pa], see `tube_pressures`; or an array (n, t) for t tubes, an
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
        configs, bodies, friction, external_wrench, pressure, members, poses, stiffness
    )
    return settle_inputs_together(inputs, coefficients, executor, on_progress)


def settle_inputs_together(
    inputs: Sequence[GraspInputs],
    coefficients: Array,
    executor: Executor | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> SettledGrasps:
    """Return the settled grasps of n checked inputs, see `settle_grasps`."""
    count = len(inputs)
    slices = [slice(begin, begin + GROUP_SIZE) for begin in range(0, count, GROUP_SIZE)]
    groups = [(inputs[chosen], coefficients[chosen]) for chosen in slices]
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
        equilibria=tuple(itertools.chain(*(part.equilibria for part in parts))),
    )


class _GroupResult(NamedTuple):
    """Values of `SettledGrasps` for a group of n grasps by m members."""

    hold: list[HoldStatus | None]
    reason: list[str]
    #: (n, 9 + 3 m) slip margin, squeeze, required friction, pose, displacement; then normal
    #: forces, friction forces and utilisation of the members
    values: Array
    equilibria: list[HeldGrip | LostContact | None]  #: (n,) see `SettledGrasps`

    def set_lost(self, number: int, settled: SettledGrasp) -> None:
        """Set the values of a grasp without contact."""
        self.hold[number], self.reason[number] = settled.hold, settled.reason
        self.equilibria[number] = settled.lost
        row = self.values[number]
        row[:] = 0.0
        row[0], row[2], row[3:6] = settled.slip_margin, np.inf, settled.pose

    def set_held(
        self, numbers: Sequence[int], at: Equilibria, given: Sequence[Pose], friction: Array
    ) -> None:
        """Set the values of grasps with equilibria."""
        rows, contacts = np.zeros((len(numbers), self.values.shape[1])), at.g.contacts
        members = contacts.members[contacts.member_starts]
        margins = find_slip_planes(at.response, friction).margin
        rows[:, 0] = np.where(at.response.is_neutral, 0.0, margins)
        rows[:, 1], rows[:, 2] = at.normal_forces.mean(axis=-1), at.required_friction
        rows[:, 3], rows[:, 4] = at.bodies.center.real, at.bodies.center.imag
        rows[:, 5] = at.bodies.angle
        rows[:, 6:9] = rows[:, 3:6] - np.array(given)
        rows[:, 8] -= 2.0 * np.pi * np.round(rows[:, 8] / (2.0 * np.pi))
        normal, friction_forces, used = rows[:, 9:].reshape(len(rows), 3, -1).swapaxes(0, 1)
        normal[:, members], friction_forces[:, members] = at.normal_forces, -at.friction_forces
        used[:] = at.sections.used
        self.values[numbers] = rows


def _settle_group(inputs: Sequence[GraspInputs], friction: Array) -> _GroupResult:
    """Return the values of settled grasps, each with its inputs and coefficient of friction."""
    count, members = len(inputs), len(inputs[0].config.robot.member_names)
    values = np.full((count, 9 + 3 * members), np.nan)
    result = _GroupResult([None] * count, [''] * count, values, [None] * count)
    groups: dict[int, tuple[Equilibria, list[int]]] = {}
    for i, grip in enumerate(attach_grips(inputs)):
        if isinstance(grip, StructureError):
            result.reason[i] = str(grip)
        elif isinstance(grip, NotHeldError):
            result.set_lost(i, lose_grasp(inputs[i], grip, float(friction[i])))
        else:
            groups.setdefault(id(grip.samples), (grip.samples, []))[1].append(i)
    for at, numbers in groups.values():  # the numbers are in the order of the samples
        given, contacts = [inputs[i].body.pose for i in numbers], at.g.contacts
        result.set_held(numbers, at, given, friction[numbers])
        verdicts, light = judge(at, given, friction[numbers]), at.judged(False)
        grasping = contacts.members[contacts.member_starts]
        for row, (i, (hold, reason)) in enumerate(zip(numbers, verdicts, strict=True)):
            result.hold[i], result.reason[i] = hold, reason
            result.equilibria[i] = HeldGrip(light, row)
            if hold in (HoldStatus.NO_CONTACT, HoldStatus.OFF_MEMBER):
                lost = LostContact.of(inputs[i]._replace(members=grasping))
                of_one = SettledGrasp(hold, reason, given[row], friction[i], lost=lost)
                result.set_lost(i, of_one)
    return result
