# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames with eliminated blocks against the same frames with one matrix."""

import frames
from hypothesis import given
from isotruss_ros.core.numerics.tolerances import ROUNDING
from isotruss_ros.core.statics.equilibrium import bend, solve, unloaded
from isotruss_ros.core.statics.structure import structure_of
import numpy as np
import robots
from robots import examples, generators


def whole(tangent):
    """Return the scaled matrix of a linearised frame without eliminated blocks."""
    matrix, free = np.zeros((len(tangent.unknowns),) * 2), tangent.frame.layout.numbering.free
    for group, blocks in zip(tangent.frame.layout.groups, tangent.matrices, strict=True):
        for indices, block in zip(np.hstack([group.outer, group.inner]), blocks, strict=True):
            matrix[np.ix_(indices, indices)] += block
    at_cuts = np.ones(len(matrix) - len(free), dtype=bool)
    free = np.append(free, at_cuts)
    return matrix[np.ix_(free, free)], free


def bent_frame(robot, rng):
    """Return a robot's frame with cuts, bent by random forces on its joints, or straight."""
    config = robots.random_state(robot, rng)
    uncut = structure_of(config).frame
    pieces = rng.integers(3 * robot.topology.n_modules, len(uncut.length), 3)
    frame = uncut.cut(pieces, uncut.length[pieces] * rng.uniform(0.2, 0.8, 3))
    loads = np.zeros((len(frame.points), 3))
    joints = len(robot.topology.joint_names)
    loads[:joints, :2] = rng.uniform(-3.0, 3.0, (joints, 2))
    rest = unloaded(frame)
    return bend(rest, loads) or rest


@examples(20)
@given(robots.robots(), generators())
def test_responses_of_robots_agree_with_those_of_one_matrix(robot, rng):
    tangent = bent_frame(robot, rng)
    rows = tangent.frame.layout.numbering.rows
    loads = rng.normal(size=(len(tangent.unknowns), 4))
    loads[:rows] *= 1e-3
    loads[rows:].reshape(-1, 3, 4)[: len(robot.topology.joint_names), 2] = 0.0
    solution, expected = tangent.solve(loads)[1], np.zeros_like(loads)
    (matrix, free), scale = whole(tangent), tangent.frame.scale[:, None]
    expected[free] = scale[free] * np.linalg.solve(matrix, (scale * loads)[free])
    for part, share in ((slice(None, rows), 1e2), (slice(rows, None), 10.0)):
        size = np.abs(expected[part]).max()
        assert np.abs(solution[part] - expected[part]).max() < share * ROUNDING * size


@examples(20)
@given(robots.robots(), generators())
def test_negative_pivots_of_blocks_and_joints_are_those_of_one_matrix(robot, rng):
    tangent = bent_frame(robot, rng)
    values = np.linalg.eigvalsh(whole(tangent)[0])
    condensed, _ = tangent.solve(np.zeros((len(tangent.unknowns), 1)))
    assert condensed.negative_pivots == (values < 0.0).sum()


def test_blocks_of_different_sizes_agree_with_an_independent_model():
    # A bent cantilever, a bent bar and a short cantilever, with hinges between them.
    points = np.array([0.0, 1.0, 1.2 + 1.0j, 2.0 + 0.8j, 2.5 + 1.2j, 3.0 + 0.5j, 3.2 - 0.5j])
    ends = [(0, 1), (2, 1), (2, 3), (3, 4), (5, 4), (5, 6)]
    found = frames.members(ends, 1e4, 25.0, 1e3, [1, 2, 4, 5])
    held = frames.supports(7, {0: 'xyr', 6: 'xyr'})
    frame = frames.frame(points, found, held)
    assert sorted(each.inner.shape for each in frame.layout.groups) == [(1, 0), (1, 3), (1, 6)]
    loads = np.where(np.arange(7)[:, None] % 2, [1.0, -2.0, 0.5], [-0.5, 1.0, 0.0])
    moved, *_ = frames.reference(points, found, held, loads)
    state = solve(unloaded(frame), loads)
    assert np.abs(state.displacements - moved).max() < ROUNDING * np.abs(moved).max()
