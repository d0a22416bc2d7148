"""
Place the robot at home: joints where the file has them, modules turned to bisect their corners.

The corner of the tube lies beyond the pinch points B and C as seen from the joint A.
"""

from __future__ import annotations

from isotruss_ros.core.constraints import Constraints, Points, Targets
from isotruss_ros.core.description import RobotDescription
from isotruss_ros.core.errors import RobotFileError
from isotruss_ros.core.layout import Layout
from isotruss_ros.core.linear import factorize
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

#: A corner closer than this to straight or to folded flat has no side on which a module could sit.
MIN_CORNER = np.deg2rad(1.0)
MAX_ITERATIONS = 50
ANGLE_TOLERANCE = 1e-13


def place_home(description: RobotDescription, layout: Layout, constraints: Constraints) -> Points:
    """
    Return the nodes at home.

    :return: (n,) nodes as complex numbers [m].
    :raises RobotFileError: a module does not fit its corner, or a member its limits.
    """
    joints = np.array([complex(*place) for place in description.joints.values()])
    outward, left = _corners(description, layout, joints)
    module = description.module
    # From the joint, as seen along the rod: B and C, one to each side of its end.
    b_arm = module.rod_length + 0.5j * module.pinch_separation * left
    angles = np.angle(outward)
    for _ in range(MAX_ITERATIONS):
        points = _points(layout, joints, angles, b_arm)
        bisection, slope = _bisection(layout, constraints, points)
        if np.abs(bisection).max() < ANGLE_TOLERANCE:
            break
        try:
            step = factorize(slope).solve(bisection)
        except np.linalg.LinAlgError:
            break
        angles = angles - np.clip(step, -0.3, 0.3)
    _refuse_misfits(description, layout, points, angles, left, bisection)
    return points


def _corners(
    description: RobotDescription, layout: Layout, joints: Points
) -> tuple[Points, NDArray[np.float64]]:
    """Return the outward direction at each corner and +1 where its next side lies to the left."""
    here = joints[layout.joint]
    ahead = joints[layout.joint[layout.following]] - here
    back = joints[layout.joint[layout.previous]] - here
    opening = np.angle(ahead * back.conj())
    for i in np.flatnonzero(
        (np.abs(opening) < MIN_CORNER) | (np.abs(opening) > np.pi - MIN_CORNER)
    ):
        raise RobotFileError(
            f'{description.source}: module {layout.module_names[i]} does not fit its corner: '
            f'the sides meet at {np.rad2deg(abs(opening[i])):.3g} degrees; '
            f'must be between 1 and 179 degrees (move the joints)'
        )
    outward = -(ahead / np.abs(ahead) + back / np.abs(back))
    return outward, np.sign((outward.conj() * ahead).imag)


def _points(layout: Layout, joints: Points, angles: NDArray[np.float64], b_arm: Points) -> Points:
    points = np.empty(layout.n_nodes, dtype=np.complex128)
    points[: len(joints)] = joints
    rod = np.exp(1j * angles)
    points[layout.b] = joints[layout.joint] + rod * b_arm
    points[layout.c] = joints[layout.joint] + rod * b_arm.conj()
    return points


def _bisection(
    layout: Layout, constraints: Constraints, points: Points
) -> tuple[NDArray[np.float64], NDArray[np.float64] | csc_matrix]:
    """Return the bisection residual (m,) and its (m, m) derivative by the modules' angles."""
    m = layout.n_modules
    targets = Targets(constraints.lengths(points), np.zeros(len(layout.grounded)))
    rows = slice(4 * m, 5 * m)
    bisection = constraints.residual(points, targets)[rows]
    modules = np.tile(np.arange(m), 2)
    nodes = np.concatenate([layout.b, layout.c])
    turning = 1j * (points[nodes] - np.tile(points[layout.joint], 2))
    spread = csc_matrix(
        (
            np.concatenate([turning.real, turning.imag]),
            (np.concatenate([2 * nodes, 2 * nodes + 1]), np.tile(modules, 2)),
        ),
        shape=(constraints.n_columns, m),
    )
    matrix = constraints.matrix(points)
    if isinstance(matrix, np.ndarray):
        return bisection, np.ascontiguousarray(matrix[rows] @ spread)
    return bisection, csc_matrix(matrix[rows] @ spread)


def _refuse_misfits(
    description: RobotDescription,
    layout: Layout,
    points: Points,
    angles: NDArray[np.float64],
    left: NDArray[np.float64],
    bisection: NDArray[np.float64],
) -> None:
    source, module = description.source, description.module
    ends = points[: len(layout.joint_names)][layout.joint]
    side = points[layout.c[layout.following]] - points[layout.b]
    along = (side.conj() * (ends[layout.following] - ends)).real
    rod = np.exp(-1j * angles)
    ahead, back = rod * side, -rod * side[layout.previous]
    # Both sides run back past the joint, B's on B's side of the rod and C's on C's.
    fits = (
        (np.abs(bisection) < 1e-9)
        & (along > 0)
        & (ahead.real < 0)
        & (back.real < 0)
        & (ahead.imag * left > 0)
        & (back.imag * left < 0)
    )
    for i in np.flatnonzero(~fits):
        raise RobotFileError(
            f'{source}: module {layout.module_names[i]} does not fit its corner: with '
            f'pinch_separation {module.pinch_separation} m and rod_length {module.rod_length} m '
            'no straight sides bisect it; use a smaller module, or joints further apart'
        )
    lengths = np.abs(side)
    lower, upper = description.min_length, description.max_length
    for i in np.flatnonzero((lengths < lower) | (lengths > upper)):
        raise RobotFileError(
            f'{source}: members: {layout.member_names[i]} is {lengths[i]:.6g} m long at home, '
            f'pinch to pinch; must be from min_length {lower} to max_length {upper} m'
        )
    for i in np.flatnonzero(lengths <= 2 * module.guide_ring_distance):
        raise RobotFileError(
            f'{source}: module.guide_ring_distance: {module.guide_ring_distance}: member '
            f'{layout.member_names[i]} is {lengths[i]:.6g} m long and must hold two of them; '
            f'must be less than {lengths[i] / 2:.6g} m'
        )
