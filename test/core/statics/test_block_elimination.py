# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames with eliminated blocks against the same frames with one matrix."""

from dataclasses import replace

import frames
from hypothesis import given
from isotruss_ros.core.numerics.tolerances import ROUNDING
from isotruss_ros.core.statics.cut_frame import CutFrame
from isotruss_ros.core.statics.elimination import Scaling
from isotruss_ros.core.statics.frame_pattern import FramePattern
from isotruss_ros.core.statics.structure import structure_of
import numpy as np
import robots
from robots import examples, generators


def whole(tangent):
    """Return a linearised frame with one matrix, which has no blocks."""
    frame, scaling = tangent.frame, tangent.frame.scaling
    uncut = getattr(frame, 'uncut', frame)
    pattern = FramePattern(uncut.members, uncut.held, uncut.rows, condensed=False)
    none = np.zeros((len(scaling.scale), 1))
    factor, _ = Scaling(pattern, scaling.scale, scaling.weight).eliminate(tangent.entries, none)
    return replace(tangent, given=factor)


def bent_frame(robot, rng):
    """Return a robot's frame with cuts, bent by random forces on its joints, or straight."""
    config = robots.random_state(robot, rng)
    uncut = structure_of(config).frame
    pieces = rng.integers(3 * robot.topology.n_modules, len(uncut.length), 3)
    frame = CutFrame(uncut, pieces, uncut.length[pieces] * rng.uniform(0.2, 0.8, 3))
    loads = np.zeros((len(frame.points), 3))
    joints = len(robot.topology.joint_names)
    loads[:joints, :2] = rng.uniform(-3.0, 3.0, (joints, 2))
    return frame.bend(loads) or frame.rest


@examples(20)
@given(robots.robots(), generators())
def test_responses_of_robots_agree_with_those_of_one_matrix(robot, rng):
    tangent = bent_frame(robot, rng)
    loads = rng.normal(size=(3 * len(tangent.frame.points), 4))
    loads.reshape(-1, 3, 4)[: len(robot.topology.joint_names), 2] = 0.0
    gaps = 1e-3 * rng.normal(size=(tangent.frame.rows.count, 4))
    expected, multipliers = whole(tangent).respond(loads, gaps)
    for factored in (None, tangent.factored):
        found, forces = tangent.respond(loads, gaps, factored)
        size = np.abs(expected).max()
        assert np.abs(found - expected).max() < 10.0 * ROUNDING * size
        assert np.abs(forces - multipliers).max() < 1e2 * ROUNDING * np.abs(multipliers).max()


@examples(20)
@given(robots.robots(), generators())
def test_negative_pivots_of_blocks_and_joints_are_those_of_one_matrix(robot, rng):
    tangent = bent_frame(robot, rng)
    expected = whole(tangent).factored.factored.negative_pivots
    assert tangent.factored.factored.negative_pivots == expected


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
    assert FramePattern(found, held, frame.rows).condensed
    moved, *_ = frames.reference(np.array(points, dtype=complex), found, held, loads, rows)
    assert np.abs(frame.solve(loads).displacements - moved).max() < ROUNDING * np.abs(moved).max()


def test_blocks_of_different_sizes_agree_with_an_independent_model():
    # A bent cantilever, a bent bar and a short cantilever, with hinges between them.
    points = np.array([0.0, 1.0, 1.2 + 1.0j, 2.0 + 0.8j, 2.5 + 1.2j, 3.0 + 0.5j, 3.2 - 0.5j])
    ends = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 6)]
    found = frames.members(ends, 1e4, 25.0, 1e3, [(1, 1), (2, 0), (4, 1), (5, 0)])
    held = frames.supports(7, {0: 'xyr', 6: 'xyr'})
    frame = frames.frame(points, found, held)
    blocks = FramePattern(found, held, frame.rows).matrix.blocks
    assert sorted(each.inner.shape for each in blocks) == [(1, 3), (1, 6), (1, 6)]
    loads = np.where(np.arange(7)[:, None] % 2, [1.0, -2.0, 0.5], [-0.5, 1.0, 0.0])
    moved, *_ = frames.reference(points, found, held, loads)
    assert np.abs(frame.solve(loads).displacements - moved).max() < ROUNDING * np.abs(moved).max()
