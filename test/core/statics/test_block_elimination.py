# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames with eliminated blocks against the same frames with one matrix."""

from dataclasses import replace

import frames
from hypothesis import given
from isotruss_ros.core.numerics.tolerances import ROUNDING
from isotruss_ros.core.statics.blocks import Layout, Numbering
from isotruss_ros.core.statics.equilibrium import bend, solve, unloaded
from isotruss_ros.core.statics.structure import structure_of
from isotruss_ros.core.statics.tangent import linearize
import numpy as np
import robots
from robots import examples, generators


def whole(tangent):
    """Return a linearised frame with one matrix, which has no blocks."""
    frame, uncut = tangent.frame, tangent.frame.uncut
    numbering = Numbering(uncut.members, uncut.held, uncut.rows.places, condensed=False)
    piece = frame.layout.whole[frame.layout.behind]
    order = np.lexsort((frame.begins[frame.layout.behind], piece))
    layout = Layout(numbering, piece, order, numbering.whole.active)
    return linearize(
        replace(frame, layout=layout), tangent.unknowns, tangent.forces.stressed[:, 0]
    )


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
    expected, solution = (frame.solve(loads)[1] for frame in (whole(tangent), tangent))
    for part, share in ((slice(None, rows), 1e2), (slice(rows, None), 10.0)):
        size = np.abs(expected[part]).max()
        assert np.abs(solution[part] - expected[part]).max() < share * ROUNDING * size


@examples(20)
@given(robots.robots(), generators())
def test_negative_pivots_of_blocks_and_joints_are_those_of_one_matrix(robot, rng):
    tangent = bent_frame(robot, rng)
    assert tangent.condensed[0].negative_pivots == whole(tangent).condensed[0].negative_pivots


def test_constraints_that_are_dependent_within_a_block_leave_the_frame_regular():
    # Two cantilevers with a hinge between them; both constraints fix the end of the first one if
    # the hinge is fixed.
    points = [0.0, 1.0, 2.0, 3.0, 4.0]
    ends = [(0, 1), (1, 2), (2, 3), (3, 4)]
    found = frames.members(ends, 1e4, 25.0, 1e3, [(1, 1), (2, 0)])
    held = frames.supports(5, {0: 'xyr', 4: 'xyr'})
    rows = np.zeros((2, 5, 3))
    rows[0, 1, 0] = rows[0, 2, 0] = rows[1, 1, 0] = 1.0
    rows[1, 2, 0] = -2.0
    loads = np.zeros((5, 3))
    loads[2] = (1.0, -1.0, 0.0)
    rows = rows.reshape(2, -1)
    frame = frames.frame(points, found, held, rows)
    moved, *_ = frames.reference(np.array(points, dtype=complex), found, held, loads, rows)
    state = solve(unloaded(frame), loads)
    assert np.abs(state.displacements - moved).max() < ROUNDING * np.abs(moved).max()


def test_blocks_of_different_sizes_agree_with_an_independent_model():
    # A bent cantilever, a bent bar and a short cantilever, with hinges between them.
    points = np.array([0.0, 1.0, 1.2 + 1.0j, 2.0 + 0.8j, 2.5 + 1.2j, 3.0 + 0.5j, 3.2 - 0.5j])
    ends = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 6)]
    found = frames.members(ends, 1e4, 25.0, 1e3, [(1, 1), (2, 0), (4, 1), (5, 0)])
    held = frames.supports(7, {0: 'xyr', 6: 'xyr'})
    frame = frames.frame(points, found, held)
    assert sorted(each.inner.shape for each in frame.layout.groups) == [(1, 0), (1, 3), (1, 6)]
    loads = np.where(np.arange(7)[:, None] % 2, [1.0, -2.0, 0.5], [-0.5, 1.0, 0.0])
    moved, *_ = frames.reference(points, found, held, loads)
    state = solve(unloaded(frame), loads)
    assert np.abs(state.displacements - moved).max() < ROUNDING * np.abs(moved).max()
