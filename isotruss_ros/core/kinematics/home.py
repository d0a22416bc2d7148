# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Home configuration: the modules are rotated at given joints until the bisections (3) hold.

The joint A is outside of the tube's corner. The rod goes from A into the triangle, to the midpoint
of the pinch points B and C, at which the two sides of the tube begin. At home, the structure with
locked rollers must be rigid and kinematically determinate.
"""

from __future__ import annotations

from isotruss_ros.core.errors import RobotFileError
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.model.topology import Topology
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.numerics.factorization import estimate_condition, factorize
from isotruss_ros.core.numerics.tolerances import COINCIDENCE, MAX_NEWTON_ITERATIONS
import numpy as np
from scipy.sparse import csc_matrix

#: Smallest difference of the angle between a corner's sides from 0 and from pi [rad]; below it,
#: the bisector of the angle is not well defined.
MIN_CORNER_ANGLE = np.deg2rad(1.0)
#: Largest condition number at home [-]; the nine-member preset has 5e2, and a robot beyond this is
#: a mechanism in double precision.
MAX_CONDITION = 1e8


def place_home(robot: Mechanism) -> Points:
    """Return the node positions at home, (n,) x + iy [m]."""
    topology, constraints, module = robot.topology, robot.constraints, robot.description.module
    joints = np.array([complex(*position) for position in robot.description.joints.values()])
    inward, signs = _corners(robot, joints)  # 1 where the next side is left of the rod, else -1
    points = np.append(joints, np.zeros(2 * topology.n_modules))
    # B and C are on both sides of the rod's end: relative to the joint, along + i across the rod.
    b_offset = module.rod_length + 0.5j * module.pinch_separation * signs
    # A bisection depends on next C, own B and C, and previous B, which turn with their rods.
    m, modules = topology.n_modules, np.arange(topology.n_modules)
    rod_modules = np.concatenate([topology.following, modules, modules, topology.previous])
    nodes = np.concatenate([topology.end, topology.b, topology.c, topology.b[topology.previous]])
    angles = np.angle(inward)
    for _ in range(MAX_NEWTON_ITERATIONS):
        directions = np.exp(1j * angles)
        points[topology.b] = joints[topology.joint] + directions * b_offset
        points[topology.c] = joints[topology.joint] + directions * b_offset.conj()
        bisection = constraints.bisection(constraints.spans(points))
        if np.abs(bisection).max() < COINCIDENCE:
            break
        # Gradients of the bisections by the nodes and the joint (fixed), after those of lengths.
        by_next_c, by_b, by_c, _, by_previous_b = constraints.gradients(points).reshape(13, m)[8:]
        by_nodes = np.concatenate([by_next_c, by_b, by_c, by_previous_b])
        node_rates = 1j * (points[nodes] - points[topology.joint[rod_modules]])
        entries = (by_nodes.conj() * node_rates).real
        jacobian = csc_matrix((entries, (np.tile(modules, 4), rod_modules)), shape=(m, m))
        try:
            step = factorize(jacobian).solve(bisection)
        except np.linalg.LinAlgError:
            break
        angles = angles - np.clip(step, -0.3, 0.3)
    if not np.abs(bisection).max() < 1e-9:
        worst = int(np.abs(bisection).argmax())
        raise _misfit(robot, worst, 'no angle of its rod bisects its sides')
    _refuse_misfits(robot, points, angles, signs)
    return points


def _corners(robot: Mechanism, joints: Points) -> tuple[Points, Array]:
    """Return the corners' inward directions, and 1 if the next side is on their left, else -1."""
    topology, corners = robot.topology, joints[robot.topology.joint]
    to_next = corners[topology.following] - corners
    to_previous = corners[topology.previous] - corners
    opening = np.abs(np.angle(to_next * to_previous.conj()))
    for i in np.flatnonzero((opening < MIN_CORNER_ANGLE) | (opening > np.pi - MIN_CORNER_ANGLE)):
        raise RobotFileError(
            f'{robot.description.source}: module {robot.module_names[i]} does not fit its corner: '
            f'the sides meet at {np.rad2deg(opening[i]):.3g} degrees; '
            f'must be between 1 and 179 degrees (move the joints)'
        )
    inward = to_next / np.abs(to_next) + to_previous / np.abs(to_previous)
    return inward, np.sign((inward.conj() * to_next).imag)


def _refuse_misfits(robot: Mechanism, points: Points, angles: Array, signs: Array) -> None:
    """Raise RobotFileError if a module or a member does not fit at home."""
    file, topology = robot.description, robot.topology
    sides = points[topology.end] - points[topology.b]
    corners = points[topology.joint]
    between_joints = corners[topology.following] - corners
    distances = np.abs(between_joints)
    projections = (sides.conj() * between_joints).real / distances
    for i in np.flatnonzero(projections <= 0.0):
        what = (
            f'member {robot.member_names[i]} would be {projections[i]:.4g} m long: its joints are '
            f'{distances[i]:.4g} m apart, and the modules take up '
            f'{distances[i] - projections[i]:.4g} m of that'
        )
        raise _misfit(robot, i, what)
    # Angles from the rods to the next sides, positive toward the next joint. Both sides continue
    # into the triangle, each on its own side of the rod.
    to_rods = np.rad2deg(signs * np.angle(sides * np.exp(-1j * angles)))
    for i in np.flatnonzero((to_rods <= 0.0) | (to_rods >= 90.0)):
        what = (
            f'its sides would leave it at {to_rods[i]:.4g} degrees to the rod; must be more than '
            '0, where they cross, and less than 90, where they run back past the joint'
        )
        raise _misfit(robot, i, what)
    lengths, ring = np.abs(sides), file.module.guide_ring_distance
    for i in np.flatnonzero((lengths < file.min_length) | (lengths > file.max_length)):
        raise RobotFileError(
            f'{file.source}: members: {robot.member_names[i]} is {lengths[i]:.6g} m long at home, '
            f'pinch to pinch; must be from min_length {file.min_length} to max_length '
            f'{file.max_length} m'
        )
    for i in np.flatnonzero(lengths <= 2.0 * ring):
        raise RobotFileError(
            f'{file.source}: module.guide_ring_distance: {ring}: member {robot.member_names[i]} '
            f'is {lengths[i]:.6g} m long and must hold two of them; '
            f'must be less than {lengths[i] / 2:.6g} m'
        )


def _misfit(robot: Mechanism, module: int, what: str) -> RobotFileError:
    """Return the error for a module that does not fit into its corner."""
    file, size = robot.description, robot.description.module
    return RobotFileError(
        f'{file.source}: module {robot.module_names[module]} does not fit its corner: '
        f'with rod_length {size.rod_length} m and pinch_separation {size.pinch_separation} m '
        f'{what}; use a smaller module, or move the joints apart'
    )


def require_determinate(robot: Mechanism, points: Points) -> None:
    """Raise RobotFileError if the matrix of (12) at home is not square and regular."""
    source, topology = robot.description.source, robot.topology
    matrix = robot.constraints.matrix(points)
    m, joints, grounded = topology.n_modules, len(topology.joint_names), len(topology.grounded)
    needed = 2 * joints - m  # grounded coordinates with which the matrix is square
    if grounded == needed and estimate_condition(matrix) < MAX_CONDITION:
        return
    if needed < 3:
        raise RobotFileError(
            f'{source}: tubes: {m} members between {joints} joints; must be at most '
            f'{2 * joints - 3}: with more of them the rollers would work against each other'
        )
    if grounded < 3 or grounded > needed:
        raise RobotFileError(
            f'{source}: supports: too {"few" if grounded < 3 else "many"}: {grounded} grounded '
            f'coordinates; must be {needed}: 2 for each of {joints} joints, less one for each of '
            f'{m} members'
        )
    movable = ', '.join(_movable_joints(topology, matrix))
    missing = f'; {needed - grounded} more members or supports are needed'
    raise RobotFileError(
        f'{source}: not rigid with the rollers locked: these joints can still move: '
        f'{movable}{missing if grounded < needed else ""}'
    )


def _movable_joints(topology: Topology, matrix: Array | csc_matrix) -> list[str]:
    """Return the names of joints that can move with locked rollers, by the constraint matrix."""
    dense = matrix if isinstance(matrix, np.ndarray) else matrix.toarray()
    _, values, vectors = np.linalg.svd(dense)
    rank = int((values > values[0] / MAX_CONDITION).sum())
    # Node motions (f, n, 2) in the null space, or that of the smallest singular value.
    first_free = min(rank, dense.shape[1] - 1)
    motions = vectors[first_free:].reshape(-1, len(topology.node_names), 2)
    amplitudes = np.linalg.norm(motions[:, : len(topology.joint_names)], axis=2).max(axis=0)
    movable = np.flatnonzero(amplitudes > 1e-3 * amplitudes.max())
    return [topology.joint_names[i] for i in movable]
