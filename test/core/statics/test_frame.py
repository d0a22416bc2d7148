# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plane frames against an independent model, cut members, and mechanisms by name."""

from dataclasses import replace
import re

import frames
from hypothesis import given
from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.statics.equilibrium import solve, unloaded
import numpy as np
import pytest
from robots import examples, generators


def assert_states_agree(state, expected, rtol):
    """Compare displacements, reactions and end forces; lengths, angles, forces, moments apart."""
    pairs = (
        (state.displacements, expected[0]),
        (state.reactions, expected[1]),
        (state.end_forces.reshape(-1, 3), expected[2].reshape(-1, 3)),
    )
    forces = max(np.abs(expected[2]).max(), np.abs(expected[1]).max())
    for (actual, wanted), least in zip(pairs, (0.0, forces, forces), strict=True):
        for columns in ([0, 1], [2]):
            difference = np.abs(actual[:, columns] - wanted[:, columns]).max()
            size = max(np.abs(wanted[:, columns]).max(), least)
            assert difference <= rtol * size, f'{difference} of {size}'


def random_case(rng):
    """Return points, members, supports and loads of a frame that stands."""
    points, bars, held = frames.random_frame(rng)
    return points, bars, held, frames.random_loads(rng, bars, len(points))


@given(generators())
@examples(30)
def test_cutting_members_changes_nothing_at_their_ends(rng):
    points, bars, held, loads = random_case(rng)
    frame, count = frames.frame(points, bars, held), len(bars.start)
    piece = rng.integers(count, size=6)
    cut = frame.cut(piece, frame.length[piece] * rng.uniform(0.1, 0.9, 6))
    state = solve(unloaded(frame), loads)
    parts = solve(unloaded(cut), np.pad(loads, ((0, 6), (0, 0))))
    last = [
        np.flatnonzero((cut.layout.whole == i) & (cut.layout.end == bars.end[i]))[0]
        for i in range(count)
    ]
    ends = np.concatenate([parts.end_forces[:count, :3], parts.end_forces[last, 3:]], axis=1)
    same = replace(
        parts,
        displacements=parts.displacements[: len(points)],
        reactions=parts.reactions[: len(points)],
        end_forces=ends,
    )
    expected = (state.displacements, state.reactions, state.end_forces)
    assert_states_agree(same, expected, 1e-8)


def moving(points, bars, held):
    """Return the names of what moves according to the refusal of a frame."""
    frame = frames.frame(points, bars, held)
    with pytest.raises(StructureError) as caught:
        unloaded(frame)
    names = re.search(r'mechanism: (.*) can move without resistance', str(caught.value))
    return set(names.group(1).split(', '))


SQUARE = [0.0, 1.0, 1.0 + 1.0j, 1.0j]
RING = [[0, 1], [1, 2], [2, 3], [3, 0]]
PINNED = [0, 1, 2, 3]


@pytest.mark.parametrize('angle', [0.0, 0.4])
def test_a_pinned_square_names_its_upper_corners_and_the_support_that_turns(angle):
    points = np.array(SQUARE) * np.exp(1j * angle)
    held = frames.supports(4, {0: 'xy', 1: 'xy'})
    assert moving(points, frames.members(RING, 1e4, 25.0, 1e3, PINNED), held) == {'n0', 'n2', 'n3'}
    # One stiff corner, or a diagonal, and it stands.
    stiff = frames.members(RING, 1e4, 25.0, 1e3, [0, 1, 3])
    unloaded(frames.frame(points, stiff, held))
    braced = frames.members([*RING, [0, 2]], 1e4, 25.0, 1e3, [*PINNED, 4])
    unloaded(frames.frame(points, braced, held))


@pytest.mark.parametrize('angle', [0.0, np.pi / 2, 0.3])
@given(rng=generators())
@examples(10)
def test_a_node_between_two_bars_in_line_is_named(angle, rng):
    # Rounding across the bars once held it up.
    first, last = rng.uniform(0.1, 3.0, 2)
    unit = {0.0: 1.0, np.pi / 2: 1j}.get(angle, np.exp(1j * angle))
    rigidities = 10.0 ** rng.uniform([[2.0], [-1.0], [1.0]], [[6.0], [4.0], [6.0]], (3, 2))
    shear = np.inf if rng.random() < 0.5 else rigidities[2]
    bars = frames.members([[0, 1], [1, 2]], *rigidities[:2], shear, [0, 1])
    points = np.array([0.0, first, first + last]) * unit
    assert moving(points, bars, frames.supports(3, {0: 'xy', 2: 'xy'})) == {'n1', 'n2'}
