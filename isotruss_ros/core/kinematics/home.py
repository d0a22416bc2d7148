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
from isotruss_ros.core.kinematics.constraints import Constraints
from isotruss_ros.core.model.description import RobotDescription
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


def place_home(
    description: RobotDescription, topology: Topology, constraints: Constraints
) -> Points:
    """Return the nodes at home, (n,) x + iy [m]."""
    joints = np.array([complex(*place) for place in description.joints.values()])
    inward, left = _corners(description, topology, joints)
    module = description.module
    # Relative to the joint along the rod: B and C on both sides of its end.
    b_arm = module.rod_length + 0.5j * module.pinch_separation * left
    angles, points = np.angle(inward), np.append(joints, np.zeros(2 * topology.n_modules))
    m, numbers = topology.n_modules, np.arange(topology.n_modules)
    modules = np.concatenate([topology.following, numbers, numbers, topology.previous])
    nodes = np.concatenate([topology.end, topology.b, topology.c, topology.b[topology.previous]])
    for _ in range(MAX_NEWTON_ITERATIONS):
        rod = np.exp(1j * angles)
        points[topology.b] = joints[topology.joint] + rod * b_arm
        points[topology.c] = joints[topology.joint] + rod * b_arm.conj()
        bisection = constraints.bisection(constraints.spans(points))
        if np.abs(bisection).max() < COINCIDENCE:
            break
        # Gradients by the next C, own B and C, the joint (fixed), and the previous B.
        ahead, b, c, _, back = constraints.gradients(points).reshape(13, m)[8:]
        turning = 1j * (points[nodes] - points[topology.joint[modules]])
        slopes = (np.concatenate([ahead, b, c, back]).conj() * turning).real
        slope = csc_matrix((slopes, (np.tile(numbers, 4), modules)), shape=(m, m))
        try:
            step = factorize(slope).solve(bisection)
        except np.linalg.LinAlgError:
            break
        angles = angles - np.clip(step, -0.3, 0.3)
    if not np.abs(bisection).max() < 1e-9:
        worst = int(np.abs(bisection).argmax())
        raise _misfit(description, topology, worst, 'no angle of its rod bisects its sides')
    _refuse_misfits(description, topology, points, angles, left)
    return points


def _corners(
    description: RobotDescription, topology: Topology, joints: Points
) -> tuple[Points, Array]:
    """Return the corners' inward directions, and 1 if the next side is on their left, else -1."""
    here = joints[topology.joint]
    ahead = joints[topology.joint[topology.following]] - here
    back = joints[topology.joint[topology.previous]] - here
    opening = np.angle(ahead * back.conj())
    for i in np.flatnonzero(
        (np.abs(opening) < MIN_CORNER_ANGLE) | (np.abs(opening) > np.pi - MIN_CORNER_ANGLE)
    ):
        raise RobotFileError(
            f'{description.source}: module {topology.module_names[i]} does not fit its corner: '
            f'the sides meet at {np.rad2deg(abs(opening[i])):.3g} degrees; '
            f'must be between 1 and 179 degrees (move the joints)'
        )
    inward = ahead / np.abs(ahead) + back / np.abs(back)
    return inward, np.sign((inward.conj() * ahead).imag)


def _refuse_misfits(
    description: RobotDescription, topology: Topology, points: Points, angles: Array, left: Array
) -> None:
    source, module = description.source, description.module
    ends = points[: len(topology.joint_names)][topology.joint]
    apart = ends[topology.following] - ends
    side = points[topology.end] - points[topology.b]
    along = (side.conj() * apart).real / np.abs(apart)
    for i in np.flatnonzero(along <= 0.0):
        distance = abs(apart[i])
        raise _misfit(
            description,
            topology,
            i,
            f'member {topology.member_names[i]} would be {along[i]:.4g} m long: its joints are '
            f'{distance:.4g} m apart, and the modules take up {distance - along[i]:.4g} m of that',
        )
    # Both sides continue into the triangle, each on its own side of the rod.
    half = np.rad2deg(left * np.angle(side * np.exp(-1j * angles)))
    for i in np.flatnonzero((half <= 0.0) | (half >= 90.0)):
        raise _misfit(
            description,
            topology,
            i,
            f'its sides would leave it at {half[i]:.4g} degrees to the rod; must be more than 0, '
            'where they cross, and less than 90, where they run back past the joint',
        )
    lengths = np.abs(side)
    lower, upper = description.min_length, description.max_length
    for i in np.flatnonzero((lengths < lower) | (lengths > upper)):
        raise RobotFileError(
            f'{source}: members: {topology.member_names[i]} is {lengths[i]:.6g} m long at home, '
            f'pinch to pinch; must be from min_length {lower} to max_length {upper} m'
        )
    for i in np.flatnonzero(lengths <= 2 * module.guide_ring_distance):
        raise RobotFileError(
            f'{source}: module.guide_ring_distance: {module.guide_ring_distance}: member '
            f'{topology.member_names[i]} is {lengths[i]:.6g} m long and must hold two of them; '
            f'must be less than {lengths[i] / 2:.6g} m'
        )


def _misfit(
    description: RobotDescription, topology: Topology, module: int, what: str
) -> RobotFileError:
    """Return the error for a module that does not fit into its corner."""
    size = description.module
    return RobotFileError(
        f'{description.source}: module {topology.module_names[module]} does not fit its corner: '
        f'with rod_length {size.rod_length} m and pinch_separation {size.pinch_separation} m '
        f'{what}; use a smaller module, or move the joints apart'
    )


def require_determinate(source: str, topology: Topology, matrix: Array | csc_matrix) -> None:
    """Raise RobotFileError if the matrix of (12) at home is not square and regular."""
    m, joints, grounded = topology.n_modules, len(topology.joint_names), len(topology.grounded)
    needed = 2 * joints - m
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
    moving = ', '.join(_what_moves(topology, matrix))
    missing = (
        f'; {needed - grounded} more members or supports are needed' if grounded < needed else ''
    )
    raise RobotFileError(
        f'{source}: not rigid with the rollers locked: these joints can still move: '
        f'{moving}{missing}'
    )


def _what_moves(topology: Topology, matrix: Array | csc_matrix) -> list[str]:
    """Return the names of the joints that can move while the rollers are locked."""
    dense = matrix if isinstance(matrix, np.ndarray) else matrix.toarray()
    _, values, vectors = np.linalg.svd(dense)
    rank = int((values > values[0] / MAX_CONDITION).sum())
    first = min(rank, dense.shape[1] - 1)
    free = vectors[first:].reshape(-1, topology.n_nodes, 2)
    motion = np.linalg.norm(free[:, : len(topology.joint_names)], axis=2).max(axis=0)
    return [topology.joint_names[i] for i in np.flatnonzero(motion > 1e-3 * motion.max())]
