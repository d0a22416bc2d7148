# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The statics of many grasps at once, in the paper's model: tubes whose sections stay round."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.errors import GraspError, IsotrussError, StructureError
from isotruss_ros.core.grasping.analysis import analyze_grasp, SPACINGS
from isotruss_ros.core.grasping.closure_stack import check_closure_stack
from isotruss_ros.core.grasping.contact import MANY
from isotruss_ros.core.grasping.contact_stack import solve_contact_stack
from isotruss_ros.core.grasping.grasp_analyses import GraspAnalyses
from isotruss_ros.core.grasping.point_stack import stack_points, Touches
from isotruss_ros.core.grasping.wrinkling_stack import find_wrinkling_stack
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.model.objects import (
    Cylinder,
    MAX_DISTANCE,
    MIN_DIAMETER,
    validate_disc,
)
from isotruss_ros.core.model.shapes import normalize
from isotruss_ros.core.numerics.arrays import Array, finite_array, Flags, Indices, Points
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.statics.frame_stack import FrameStack
from isotruss_ros.core.statics.pressures import Pressure, tube_pressures
import numpy as np
from numpy.typing import ArrayLike

#: Grasps that are computed together: as many as keep their matrices in the processor's cache.
TOGETHER = 128
#: Rods of a configuration are as long as those of the robot, to this [m].
ROD_TOLERANCE = 1e-6


class _Grasps(NamedTuple):
    """What is to be analysed; n grasps."""

    robot: Robot
    nodes: Points
    centers: Points
    diameters: Array
    friction: float
    wrenches: Array
    spacing: float
    pressures: tuple[float, ...]


@single_threaded
def analyze_grasps(
    robot: Robot,
    nodes: ArrayLike,
    centers: ArrayLike,
    diameters: ArrayLike,
    friction: float = 0.5,
    external_wrenches: ArrayLike = (0.0, 0.0, 0.0),
    spacing: float = 0.005,
    pressure: Pressure | None = None,
) -> GraspAnalyses:
    """
    Analyse many grasps of one robot: contact (5) to (8), force closure (10), stiffness, wrinkling.

    Each is analysed as `analyze_grasp(..., flattening=False)` does: the paper's model, in which
    the sections of the tubes stay round. Those whose contact takes an unusual search, and those
    whose frame may be a mechanism, are handed to it.

    :param robot: the robot.
    :param nodes: (n, n_nodes, 2) node positions, each as `Configuration.nodes`, robot frame [m].
    :param centers: (n, 2) of the objects, robot frame; their angle does not matter [m].
    :param diameters: (n,) of the objects, or one for all [m].
    :param friction: coefficient between tubes and objects, not negative.
    :param external_wrenches: (n, 3) or one for all: (fx, fy, m) on each object about its centre
        [N, N m].
    :param spacing: of the contact points along the tubes [m].
    :param pressure: gauge, of the tubes in all configurations, see `analyze_grasp` [Pa].
    :raises GraspError: an argument is not usable, or nodes are not those of this robot: the number
        of the grasp is named.
    :raises StructureError: a pressure is not usable.
    """
    given = _numbers(nodes, (-1, len(robot.node_names), 2), 'nodes (x, y) [m]')
    count = len(given)
    middle = _numbers(centers, (count, 2), "the objects' centres [m]")
    size = _numbers(diameters, (count,), "the objects' diameters [m]")
    wrenches = _numbers(external_wrenches, (count, 3), 'external wrenches (fx, fy, m)')
    mu, gap = finite_array([friction, spacing], 2, 'friction and spacing [m]', GraspError)
    if mu < 0.0:
        raise GraspError(f'friction {friction!r}: must not be negative')
    if not SPACINGS[0] <= gap <= SPACINGS[1]:
        raise GraspError(f'spacing {spacing!r} m: must be from {SPACINGS[0]} to {SPACINGS[1]} m')
    far = np.maximum(size, np.abs(middle).max(axis=1)) > MAX_DISTANCE
    wrong = np.flatnonzero(far | (size < MIN_DIAMETER))
    if len(wrong):
        i = int(wrong[0])
        try:
            validate_disc(middle[i], size[i])
        except GraspError as error:
            raise GraspError(f'grasp {i}: {error}') from None
    grasps = _Grasps(
        robot,
        np.ascontiguousarray(given).view(np.complex128)[:, :, 0],
        middle[:, 0] + 1j * middle[:, 1],
        size,
        float(mu),
        wrenches,
        float(gap),
        tube_pressures(robot.description, pressure),
    )
    _check_rods(grasps)
    found = GraspAnalyses.empty(count, len(robot.member_names))
    for first in range(0, count, TOGETHER):
        chosen = np.arange(first, min(first + TOGETHER, count))
        for i in chosen[~_analyze_together(grasps, chosen, found)].tolist():
            _analyze_alone(grasps, i, found)
    return found


def _numbers(values: ArrayLike, shape: tuple[int, ...], what: str) -> Array:
    """Return finite numbers of a shape, whose first length may be free (-1) or left out."""
    array = np.asarray(values)
    full = array.shape
    if len(full) == len(shape) - 1 and shape[0] >= 0:
        full = (shape[0], *full)
    fits = full[1:] == shape[1:] and len(full) == len(shape) and shape[0] in (-1, full[0])
    if not fits or array.dtype.kind not in 'iuf':
        raise GraspError(f'{what}: {array.dtype} {array.shape}: must be numbers {shape}')
    every = np.broadcast_to(array.astype(np.float64), full)
    wrong = np.argwhere(~np.isfinite(every))
    if len(wrong):
        raise GraspError(f'{what}: grasp {wrong[0, 0]}: must be finite numbers')
    return every


def _check_rods(grasps: _Grasps) -> None:
    """Refuse nodes that are not those of the robot: its modules do not change their shape."""
    robot, m = grasps.robot, grasps.robot.topology.n_modules
    lengths = robot.constraints.lengths(grasps.nodes.T)[m:]
    off = np.abs(lengths - robot.home_targets.lengths[m:, None])
    if (off > ROD_TOLERANCE).any():
        row, i = np.unravel_index(int(off.argmax()), off.shape)
        module = robot.module_names[row % m]
        raise GraspError(
            f'grasp {i}: nodes of module {module} are {off[row, i]:g} m off the lengths of its '
            f'triangle: must be nodes of a configuration of robot {robot.name}'
        )


def _analyze_together(grasps: _Grasps, chosen: Indices, found: GraspAnalyses) -> Flags:
    """Analyse some grasps, and return of which (n,) that gave the numbers in `found`."""
    try:
        stack = FrameStack(grasps.robot, grasps.nodes[chosen].T, grasps.pressures)
        centers, arm = grasps.centers[chosen], 0.5 * grasps.diameters[chosen]
        radius = arm + 0.5 * grasps.robot.description.tube_diameter
        points = stack_points(stack, centers, radius, grasps.spacing)
        if not len(points.grasp):
            # No tube is within reach of any of the objects.
            return np.zeros(len(chosen), dtype=bool)
        loaded = stack.load(points.owner, points.pieces, points.slot)
        contact = solve_contact_stack(points, loaded, radius)
    except (StructureError, np.linalg.LinAlgError):
        # One of them at least has no stiffness; which, and why, they tell one by one.
        return np.zeros(len(chosen), dtype=bool)
    n, m = len(chosen), len(grasps.robot.member_names)
    touching = contact.forces > 0.0
    touches = Touches(points, loaded, np.arange(n), touching)
    used = touches.used
    forces = np.zeros(used.shape)
    normals, arms = np.ones((2, *used.shape), dtype=np.complex128)
    forces[used] = contact.forces[touches.place[used]]
    arms[used] = contact.arms[touches.place[used]]
    normals[used] = normalize(arms[used])
    pressed = -(forces * normals).sum(axis=1)
    wrench = grasps.wrenches[chosen]
    load = np.stack(
        [pressed.real + wrench[:, 0], pressed.imag + wrench[:, 1], wrench[:, 2] / arm], axis=1
    )
    closure = check_closure_stack(1j * normals, forces, load, grasps.friction)
    gauge = np.array(grasps.pressures)[grasps.robot.topology.tube]
    local = forces * normals * touches.axis.conj()
    utilisation, places = find_wrinkling_stack(loaded, points, touches, local, gauge)
    key = points.grasp * m + points.member
    counts = np.bincount(key[touching], minlength=n * m)
    start, end = np.full(n * m, np.inf), np.full(n * m, -np.inf)
    np.minimum.at(start, key[touching], points.place[touching] - 0.5 * grasps.spacing)
    np.maximum.at(end, key[touching], points.place[touching] + 0.5 * grasps.spacing)
    spans = np.where(counts[:, None] > 0, np.stack([start, end], axis=1), np.nan)
    good = contact.settled & ~loaded.suspicious & (points.counts <= MANY)
    values = GraspAnalyses(
        {},
        closure.closed & used.any(axis=1),
        closure.residual,
        closure.tolerance,
        closure.required_friction,
        closure.margin,
        np.stack([pressed.real, pressed.imag, np.zeros(n)], axis=1),
        (grasps.spacing * counts).reshape(n, m),
        spans.reshape(n, m, 2),
        np.bincount(key, contact.forces, minlength=n * m).reshape(n, m),
        utilisation,
        places,
        _stiffness(touches, arms),
    )
    found.put(chosen[good], values, good)
    return good


def _stiffness(touches: Touches, arms: Points) -> Array:
    """Return the wrenches (n, 3, 3) that small motions of the objects with their contacts take."""
    n, count = arms.shape
    inward = touches.axis.conj()
    local = np.stack([inward, 1j * inward, 1j * arms * inward], axis=2)
    motion = np.concatenate([local.real, local.imag], axis=1)
    used = np.concatenate([touches.used, touches.used], axis=1)
    motion *= used[:, :, None]
    compliance = touches.compliance.reshape(n, 2 * count, 2 * count)
    both = used[:, :, None] & used[:, None, :]
    forces = np.linalg.solve(np.where(both, compliance, np.eye(2 * count)), motion)
    stiffness = motion.transpose(0, 2, 1) @ forces
    return 0.5 * (stiffness + stiffness.transpose(0, 2, 1))


def _analyze_alone(grasps: _Grasps, i: int, found: GraspAnalyses) -> None:
    """Analyse one grasp, and put numbers or error into `found`."""
    robot, center = grasps.robot, grasps.centers[i]
    # The travel of its rollers does not matter to the statics.
    config = Configuration(robot, np.zeros(len(robot.roller_names)), grasps.nodes[i].copy())
    cylinder = Cylinder((center.real, center.imag), grasps.diameters[i])
    try:
        analysis = analyze_grasp(
            config,
            cylinder,
            grasps.friction,
            grasps.wrenches[i],
            spacing=grasps.spacing,
            flattening=False,
            pressure=grasps.pressures,
        )
    except IsotrussError as error:
        found.errors[i] = error
    else:
        found.put_one(i, analysis, robot.member_names)
