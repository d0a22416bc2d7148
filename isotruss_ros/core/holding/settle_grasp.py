# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Equilibria of free objects in grasps: `settle_grasp` of one, `settle_grasps` of many."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
import itertools
from typing import Any, NamedTuple, TypeAlias

from isotruss_ros.core.errors import GraspError, IsotrussError, StructureError
from isotruss_ros.core.holding.attach_grip import attach_grips
from isotruss_ros.core.holding.grip_response import find_slip_planes
from isotruss_ros.core.holding.held_grip import (
    Equilibria,
    GraspInputs,
    HeldGrip,
    HoldStatus,
    NotHeldError,
)
from isotruss_ros.core.holding.overlaps import MAX_DISPLACEMENT, SKIN_TOLERANCE
from isotruss_ros.core.holding.settled_grasp import LostContact, SettledGrasp, SettledGrasps
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.manipulation.grip import check_member_names, find_members
from isotruss_ros.core.model.convex_object import check_load, ConvexObject
from isotruss_ros.core.model.pose import check_range, Pose
from isotruss_ros.core.numerics.argument_kinds import check_kind, check_kinds
from isotruss_ros.core.numerics.arrays import Array, Indices, MAX_MAGNITUDE
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.tolerances import ROUNDING
from isotruss_ros.core.statics.tube_stiffness import Pressure, tube_pressures
import numpy as np
from numpy.typing import ArrayLike

# Equilibrium of a free object in a grasp: `settle_grasp`.


@check_kinds
@single_threaded
def settle_grasp(
    config: Configuration,
    body: ConvexObject,
    friction: float | None = None,
    external_wrench: ArrayLike = (0.0, 0.0, 0.0),
    pressure: Pressure | None = None,
    members: Sequence[str] | None = None,
    stiffness: float = 1.0,
) -> SettledGrasp:
    """
    Return the equilibrium of a grasped object near its measured pose.

    The object is free, friction acts on the tubes, and the contact history (how the contacts
    rolled before) is unknown. For a disc between two members, statics determines the friction
    forces and the position across the members' bisector. The measured position along the bisector
    determines the squeeze. For other shapes and for three members see `least_friction`.

    :param config: configuration of the robot, with rollers at rest.
    :param body: the object at its measured pose.
    :param friction: coefficient of friction between tube and object, not negative. If None, the
        coefficient of the object is used, or 0.5 if the object has none.
    :param external_wrench: (fx, fy, m) on the object about the origin of its frame [N, N m].
    :param pressure: gauge pressure [Pa], see `tube_pressures`; None: the pressure of the robot
        file.
    :param members: names `t/j-k` of the two or three grasping members; None: the members that the
        object overlaps, or if it overlaps fewer than two, the two nearest.
    :param stiffness: factor on EA, EI and GA of the tubes [-].
    :raises GraspError: an argument is invalid.
    :raises StructureError: a pressure is invalid, the robot is a mechanism, or its stiffness laws
        contradict each other.
    """
    body = body.smoothed(0.5 * config.robot.description.tube_diameter)
    indices = check_members(config.robot, members)
    checked = check_inputs(config, body, friction, external_wrench, pressure, indices, stiffness)
    return settle_inputs(*checked)


def check_members(robot: Mechanism, members: Sequence[str] | None) -> Indices | None:
    """Return the indices of grasping members given by their names; None if not given."""
    if members is None:
        return None
    return find_members(robot.topology, check_member_names(members)).members


def check_inputs(
    config: Configuration,
    body: ConvexObject,
    friction: float | None,
    external_wrench: ArrayLike,
    pressure: Pressure | None,
    members: Indices | None,
    stiffness: float,
) -> tuple[GraspInputs, float]:
    """Return the checked inputs of a grasp, and its coefficient of friction."""
    mu, wrench = check_load(body, friction, external_wrench)
    gauge = tube_pressures(config.robot.description, pressure)
    factor = check_range(stiffness, 'stiffness', '', 1.0 / MAX_MAGNITUDE, MAX_MAGNITUDE)
    return GraspInputs(config, body, members, wrench, gauge, factor), mu


def settle_inputs(inputs: GraspInputs, friction: float) -> SettledGrasp:
    """Return the settled grasp of checked inputs, see `settle_grasp`."""
    (grip,) = attach_grips([inputs])
    if isinstance(grip, StructureError):
        raise grip
    if isinstance(grip, NotHeldError):
        return lose_grasp(inputs, grip, friction)
    return assess_equilibrium(inputs.body.pose, grip, friction)


def lose_grasp(inputs: GraspInputs, error: NotHeldError, friction: float) -> SettledGrasp:
    """Return the settled grasp of an object without an equilibrium."""
    config, body = inputs.config, inputs.body
    reason, depths = str(error), member_depths(config, body)
    deepest = int(depths.argmax())
    if depths[deepest] > ROUNDING:
        name, depth = config.robot.member_names[deepest], depths[deepest]
        reason += f'; the object is {1e3 * depth:.3g} mm deep in {name}'
    lost = LostContact.of(inputs)
    return SettledGrasp(error.hold, reason, body.pose, friction, lost=lost)


def assess_equilibrium(given: Pose, grip: HeldGrip, friction: float) -> SettledGrasp:
    """Return the settled grasp at an equilibrium, with its hold status; `given` is its pose."""
    ((hold, reason),) = judge(grip.alone, [given], np.array([friction]))
    if hold not in (HoldStatus.NO_CONTACT, HoldStatus.OFF_MEMBER):
        return SettledGrasp(hold, reason, given, friction, grip)
    lost = LostContact.of(grip.inputs._replace(body=grip.body.moved_to(given)))
    return SettledGrasp(hold, reason, given, friction, lost=lost)


def judge(at: Equilibria, given: Sequence[Pose], friction: Array) -> list[tuple[HoldStatus, str]]:
    """
    Return the hold statuses of n equilibria, and the reasons in words; empty for a held object.

    The poses `given` and the coefficients of friction (n,) are those of the samples.
    """
    structure, used = at.g.structure, at.sections.used
    names, diameter = structure.config.robot.member_names, 2.0 * structure.tube_radius
    x, y, angles = np.array(given).T
    turned = np.exp(1j * angles) * at.g.bodies.shape.centroid
    shifts = np.abs(at.bodies.middle - (x + 1j * y + turned))
    others, depths = at.depths_in_others
    violations = {
        HoldStatus.NO_CONTACT: at.normal_forces.min(axis=-1) <= 0.0,
        HoldStatus.OFF_MEMBER: ~at.are_on_members,
        HoldStatus.FAR: shifts > MAX_DISPLACEMENT * diameter,
        HoldStatus.OTHER_CONTACT: depths.max(axis=1, initial=0.0)
        > SKIN_TOLERANCE * structure.tube_radius,
        HoldStatus.SLIPS: at.required_friction > friction,
        HoldStatus.UNSTABLE: ~at.response.stable,
        HoldStatus.WRINKLES: used.max(axis=1) > 1.0,
    }

    def detail(hold: HoldStatus, i: int) -> str:
        """Return the value that violates the condition of a sample."""
        if hold is HoldStatus.FAR:
            return f'{1e3 * shifts[i]:.3g} mm'
        if hold is HoldStatus.OTHER_CONTACT:
            return names[others[depths[i].argmax()]]
        if hold is HoldStatus.SLIPS:
            return f'coefficient {at.required_friction[i]:.3g} against {friction[i]:.3g}'
        if hold is HoldStatus.WRINKLES:
            worst = int(used[i].argmax())
            return f'{names[worst]} has {used[i, worst]:.3g} times its wrinkling moment'
        return ''

    verdicts = []
    # Columns: conditions in the order in which they are stated.
    for i, row in enumerate(zip(*(flags.tolist() for flags in violations.values()), strict=True)):
        hold = next((hold for hold, wrong in zip(violations, row, strict=True) if wrong), None)
        reason = '' if hold is None else ': '.join(filter(None, (hold.value, detail(hold, i))))
        verdicts.append((hold or HoldStatus.HELD, reason))
    return verdicts


# Check of the arguments of `settle_grasps`, each of which is one value or one for each grasp.

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


# Equilibria of many free objects at once: `settle_grasps`.

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
