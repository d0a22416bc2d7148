# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The neighbour list gives the same close pairs as all pairs."""

from types import SimpleNamespace

from isotruss_ros.core.safety.barrier_law import BarrierLaw
from isotruss_ros.core.safety.barriers import NeighborList
import numpy as np
import pytest

LAW = BarrierLaw(0.1, 0.2)


def grip_of(center=0.0, turn=0.0, reach=1.0, members=('P-Q', 'Q-R')):
    """Return a stand-in of the grip of a rod from the centre to its tip."""
    shape = SimpleNamespace(reach=reach)
    return SimpleNamespace(
        members=members, body=SimpleNamespace(center=center, turn=turn, shape=shape)
    )


def tip(grip):
    """Return the tip of the rod."""
    body = grip.body
    return body.center + body.shape.reach * np.exp(1j * body.turn)


@pytest.mark.parametrize('seed', range(5))
@pytest.mark.parametrize('held', [False, True])
def test_neighbor_list_agrees_with_all_pairs(held, seed):
    rng, pairs = np.random.default_rng(seed), NeighborList(LAW)
    points = rng.uniform(-1.5, 1.5, 12) + 1j * rng.uniform(-1.5, 1.5, 12)
    grip, counts = grip_of() if held else None, set()
    for step in range(400):
        if step % 50 == 0:
            speeds = 0.01 * np.exp(2j * np.pi * rng.uniform(size=12)) - 0.004 * points
            turning = rng.choice([-0.03, 0.03])
        points = points + speeds
        if held:
            body = grip.body
            reach = rng.uniform(1.0, 2.0) if step % 90 == 0 else body.shape.reach
            grip = grip_of(body.center + 0.002, body.turn + turning, reach)
        others = points - tip(grip) if held else points[:6] - points[6:]
        distances = np.abs(others)
        config = SimpleNamespace(points=points)
        indices, values = pairs.find_close(config, grip, distances.__getitem__)
        assert indices.tolist() == np.flatnonzero(distances < LAW.active_below).tolist()
        assert values.tolist() == distances[indices].tolist()
        counts.add(len(indices))
    assert len(counts) > 1
