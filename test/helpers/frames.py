# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random plane frames, and a model of them that shares nothing with the package."""

from typing import NamedTuple

from isotruss_ros.core.statics.blocks import Bisections, Numbering
from isotruss_ros.core.statics.frame import Frame
import numpy as np
from scipy.linalg import null_space


class Members(NamedTuple):
    """Members between nodes, with EA, EI and GA, and whether the start is pinned."""

    start: np.ndarray
    end: np.ndarray
    section: np.ndarray
    pinned: np.ndarray


def members(ends, axial, flexural, shear=np.inf, pins=()):
    """Return members between pairs of nodes; the starts of `pins` transmit no moment."""
    ends = np.array(ends, dtype=np.intp).reshape(-1, 2)
    pinned = np.isin(np.arange(len(ends)), pins)
    rigidities = [np.broadcast_to(x, len(ends)).astype(float) for x in (axial, flexural, shear)]
    return Members(ends[:, 0], ends[:, 1], np.array(rigidities), pinned)


def supports(n, held):
    """Return the (n, 3) flags of what is held: {node: 'xy'}, with r for the rotation."""
    flags = np.zeros((n, 3), dtype=bool)
    for node, axes in held.items():
        flags[node, ['xyr'.index(axis) for axis in axes]] = True
    return flags


def frame(points, members_, held):
    """Return the package's frame; nodes are called n0, n1, ... ."""
    names = [f'n{i}' for i in range(len(points))]
    points = np.asarray(points, dtype=complex)
    start, end, section, pinned = members_
    no_modules = Bisections(np.zeros((0, 5), dtype=np.intp))
    return Frame.of(points, section, Numbering(names, start, end, pinned, held, no_modules))


def random_frame(rng):
    """Return points, members and supports of a stable frame, its rigidities within a decade."""
    while True:
        n = int(rng.integers(3, 8))
        points = rng.uniform(-2.0, 2.0, n) + 1j * rng.uniform(-2.0, 2.0, n)
        apart = np.abs(points[:, None] - points)[np.triu_indices(n, 1)]
        if apart.min() < 0.4:
            continue
        pairs = {(int(rng.integers(i)), i) for i in range(1, n)}
        for _ in range(int(rng.integers(1, n + 1))):
            pairs.add(tuple(sorted(map(int, rng.choice(n, 2, replace=False)))))
        ends = [pair[:: rng.choice([-1, 1])] for pair in sorted(pairs)]
        k = len(ends)
        bars = members(
            ends,
            *10.0 ** (np.array([[4.0], [1.5], [3.0]]) + rng.uniform(-0.3, 0.3, (3, k))),
            np.flatnonzero(rng.random(k) < 0.3),
        )
        held = np.zeros((n, 3), dtype=bool)
        for node in rng.choice(n, int(rng.integers(1, 4)), replace=False):
            held[node] = rng.random(3) < 0.6
        if stands(points, bars, held):
            return points, bars, held


def turning(bars, n):
    """Return which of the nodes have a rotation: those where a member is not pinned."""
    turns = np.zeros(n, dtype=bool)
    turns[bars.start[~bars.pinned]] = True
    turns[bars.end] = True
    return turns


def member_stiffness(span, axial, flexural, shear, pinned):
    """Return the (6, 6) stiffness in the plane of a member between nodes, and its turn."""
    length, unit = abs(span), span / abs(span)
    give = np.diag([length / axial, length**3 / (3.0 * flexural) + length / shear, 0.0])
    give[1, 2] = give[2, 1] = length**2 / (2.0 * flexural)
    give[2, 2] = length / flexural
    carry = np.array([[-1.0, 0, 0, 1, 0, 0], [0, -1, -length, 0, 1, 0], [0, 0, -1, 0, 0, 1]])
    block = np.array([[unit.real, unit.imag, 0], [-unit.imag, unit.real, 0], [0, 0, 1]])
    turn = np.kron(np.eye(2), block)
    local = carry.T @ np.linalg.inv(give) @ carry
    if pinned:  # the start turns so that it has no moment
        local -= np.outer(local[:, 2], local[2]) / local[2, 2]
    return turn.T @ local @ turn, turn


def _assembled(points, bars):
    """Return the stiffness of all nodes, and place, stiffness and turn of each member."""
    matrix, parts = np.zeros((3 * len(points), 3 * len(points))), []
    for start, end, section, pinned in zip(*bars[:2], bars.section.T, bars.pinned, strict=True):
        place = [*range(3 * start, 3 * start + 3), *range(3 * end, 3 * end + 3)]
        part, turn = member_stiffness(points[end] - points[start], *section, pinned)
        matrix[np.ix_(place, place)] += part
        parts.append((place, part, turn))
    return matrix, parts


def _free(bars, held):
    free = ~held
    free[:, 2] &= turning(bars, len(held))
    return np.flatnonzero(free)


def stands(points, bars, held):
    """Return whether a frame can deform, and is far from being a mechanism."""
    matrix, _ = _assembled(points, bars)
    free = _free(bars, held)
    part = matrix[np.ix_(free, free)]
    diagonal = np.diagonal(part)
    if len(free) < 3 or diagonal.min() <= 0.0:
        return False
    scale = 1.0 / np.sqrt(diagonal)
    return np.linalg.eigvalsh(scale[:, None] * part * scale)[0] > 1e-5


def reference(points, bars, held, loads, rows):
    """Return displacements (n, 3), reactions (n, 3) and end forces (k, 6)."""
    matrix, parts = _assembled(points, bars)
    free, pushed, moved = _free(bars, held), loads.ravel(), np.zeros(held.size)
    scale = 1.0 / np.sqrt(np.diagonal(matrix)[free])
    basis = null_space(rows[:, free] * scale)
    part = scale[:, None] * matrix[np.ix_(free, free)] * scale
    moved[free] = scale * (
        basis @ np.linalg.solve(basis.T @ part @ basis, basis.T @ (scale * pushed[free]))
    )
    rest = matrix @ moved - pushed
    tied = scale[:, None] * rows[:, free].T
    rest += rows.T @ np.linalg.lstsq(tied, -scale * rest[free], rcond=None)[0]
    reactions = np.where(held, rest.reshape(-1, 3), 0.0)
    forces = np.array([turn @ part @ moved[place] for place, part, turn in parts])
    return moved.reshape(-1, 3), reactions, forces
