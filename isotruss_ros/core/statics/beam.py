"""
Two-node beams of the plane: the force-displacement relation (2) of a straight member.

Ends move by (ux, uy, theta). EA, EI and GA are the section stiffness (Timoshenko; an infinite GA
is an Euler-Bernoulli beam). All functions take arrays over members.
"""

from __future__ import annotations

from isotruss_ros.core.numerics.arrays import Array, Flags, Points
import numpy as np


def local_stiffness(length: Array, axial: Array, flexural: Array, shear: Array) -> Array:
    """
    Return (2): stiffness matrices in the members' own frames (x from start to end).

    See Przemieniecki, Theory of Matrix Structural Analysis, section 5.6.

    :param length: (k,) [m].
    :param axial: (k,) EA [N].
    :param flexural: (k,) EI [N m^2].
    :param shear: (k,) GA [N], infinite for no shear deformation.
    :return: (k, 6, 6), rows and columns (ux, uy, theta) at start and end.
    """
    flexibility = 12.0 * flexural / (shear * length**2)
    bend = flexural / ((1.0 + flexibility) * length)
    force, moment = 12.0 * bend / length**2, 6.0 * bend / length
    near, far = (4.0 + flexibility) * bend, (2.0 - flexibility) * bend
    matrix = np.zeros((*np.shape(length), 6, 6))
    matrix[:, [0, 3], [0, 3]] = (axial / length)[:, None]
    matrix[:, [0, 3], [3, 0]] = -(axial / length)[:, None]
    matrix[:, [1, 4], [1, 4]] = force[:, None]
    matrix[:, [1, 4], [4, 1]] = -force[:, None]
    matrix[:, [1, 1, 2, 5], [2, 5, 1, 1]] = moment[:, None]
    matrix[:, [4, 4, 2, 5], [2, 5, 4, 4]] = -moment[:, None]
    matrix[:, [2, 5], [2, 5]] = near[:, None]
    matrix[:, [2, 5], [5, 2]] = far[:, None]
    return matrix


def with_pins(stiffness: Array, pinned_start: Flags, pinned_end: Flags) -> Array:
    """
    Return stiffness matrices of members whose ends turn freely where they are pinned.

    :param stiffness: (k, 6, 6) of members fixed at both ends.
    :param pinned_start: (k,) whether no moment is transmitted at the start.
    :param pinned_end: (k,) the same at the end.
    :return: (k, 6, 6), rows and columns of free rotations zero.
    """
    matrix = stiffness.copy()
    for rotation, pinned in ((2, pinned_start), (5, pinned_end)):
        column = matrix[pinned][:, :, rotation]
        # A member without bending stiffness has none against this rotation anyway.
        pivot = column[:, rotation]
        gain = np.divide(1.0, pivot, out=np.zeros_like(pivot), where=pivot > 0.0)
        matrix[pinned] -= gain[:, None, None] * column[:, :, None] * column[:, None, :]
        matrix[pinned, rotation, :] = 0.0
        matrix[pinned, :, rotation] = 0.0
    # Exactly zero across a bar: what rounding leaves would hide a mechanism of bars.
    bar = pinned_start & pinned_end
    for across in (1, 4):
        matrix[bar, across, :] = 0.0
        matrix[bar, :, across] = 0.0
    return matrix


def directions(direction: Points) -> Array:
    """
    Return the matrices that turn displacements of the plane into those along the members.

    :param direction: (k,) unit vectors from start to end.
    :return: (k, 6, 6), orthogonal.
    """
    matrix = np.zeros((len(direction), 6, 6))
    for at in (0, 3):
        matrix[:, at, at] = matrix[:, at + 1, at + 1] = direction.real
        matrix[:, at, at + 1] = direction.imag
        matrix[:, at + 1, at] = -direction.imag
        matrix[:, at + 2, at + 2] = 1.0
    return matrix
