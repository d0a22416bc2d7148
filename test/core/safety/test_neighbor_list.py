# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The neighbour list gives the same close pairs as all pairs."""

from types import SimpleNamespace

from isotruss_ros.core.safety.barrier_law import BarrierLaw
from isotruss_ros.core.safety.barriers import EvaluatedState, NeighborList
import numpy as np
import pytest

LAW = BarrierLaw(0.1, 0.2)


def grip_of(center=0.0, turn=0.0, reach=1.0, members=('P-Q', 'Q-R')):
    """Return a stand-in of the grip of a rod from the centre to its tip."""
    shape = SimpleNamespace(reach=reach)
    return SimpleNamespace(
        members=members, body=SimpleNamespace(center=center, turn=turn, shape=shape)
    )


def config_of(points):
    """Return a stand-in of a configuration with some points."""
    return SimpleNamespace(points=np.asarray(points, dtype=complex))


STILL = config_of([0.0])


def tip(grip):
    """Return the tip of the rod."""
    body = grip.body
    return body.center + body.shape.reach * np.exp(1j * body.turn)


@pytest.mark.parametrize('seed', range(5))
@pytest.mark.parametrize('held', [False, True])
def test_neighbor_list_agrees_with_all_pairs(held, seed):
    rng, pairs = np.random.default_rng(seed), NeighborList(LAW)
    points = rng.uniform(-1.5, 1.5, 12) + 1j * rng.uniform(-1.5, 1.5, 12)
    grip, counts, measured = grip_of() if held else None, set(), 0
    for step in range(400):
        if step % 50 == 0:
            speeds = 0.01 * np.exp(2j * np.pi * rng.uniform(size=12)) - 0.004 * points
            turning = rng.uniform(-0.02, 0.02)
        points = points + speeds
        if held:
            body = grip.body
            reach = rng.uniform(0.5, 1.5) if step % 90 == 0 else body.shape.reach
            grip = grip_of(body.center + 0.002, body.turn + turning, reach)
        others = points - tip(grip) if held else points[:6] - points[6:]
        distances = np.abs(others)

        def measure(indices, distances=distances):
            nonlocal measured
            measured += len(distances[indices])
            return distances[indices]

        indices, values = pairs.find_close(config_of(points), grip, measure)
        assert indices.tolist() == np.flatnonzero(distances < LAW.active_below).tolist()
        assert values.tolist() == distances[indices].tolist()
        counts.add(len(indices))
    assert len(counts) > 1
    assert measured < 0.8 * 400 * len(distances)


@pytest.mark.parametrize('change', [0.5, -0.5])
def test_turn_of_the_object_counts_with_its_reach(change):
    before, after = grip_of(reach=0.4), grip_of(turn=change, reach=0.4)
    for spare, holds in ((0.19, False), (0.21, True)):
        assert EvaluatedState(STILL, before, spare).holds(STILL, after) == holds


@pytest.mark.parametrize('other', [{'reach': 1.001}, {'members': ('P-Q',)}])
def test_another_shape_or_grip_is_measured_anew(other):
    assert EvaluatedState(STILL, grip_of(), 100.0).holds(STILL, grip_of())
    assert not EvaluatedState(STILL, grip_of(), 100.0).holds(STILL, grip_of(**other))


def test_list_reaches_half_a_band_beyond_the_active_pairs():
    assert NeighborList(LAW).listed_below == pytest.approx(LAW.active_below + 0.5 * LAW.band)


@pytest.mark.parametrize('moved', [0.9, 1.1])
def test_all_pairs_are_measured_once_two_parts_may_have_crossed_the_skin(moved):
    pairs, skin, sizes = NeighborList(LAW), 0.5 * LAW.band, []
    distances = np.array([0.9 * LAW.active_below, 2.0])

    def measure(indices):
        sizes.append(len(distances[indices]))
        return distances[indices]

    pairs.find_close(STILL, None, measure)
    pairs.find_close(config_of([0.5 * moved * skin]), None, measure)
    assert sizes == [2, 1 if moved < 1.0 else 2]
