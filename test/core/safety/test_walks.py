"""Twenty random walks of a thousand steps; `python test/helpers/walks.py` walks more."""

import functools

from isotruss_ros.core import Status
import pytest
import walks


@functools.cache
def walk(seed):
    return walks.walk(seed, 1000, slide=seed % 3 == 2)


@pytest.mark.parametrize('seed', range(20))
def test_walk_never_crosses_a_bound(seed):
    found = walk(seed)
    assert not found.crossed, found


def test_walks_came_to_bounds_that_they_would_have_crossed():
    """They prove something: some are stopped, and without the guard they do cross."""
    close = [seed for seed in range(20) if walk(seed).lowest.min() < 0.0015]
    assert len(close) >= 5
    statuses = {status for seed in range(20) for status in walk(seed).statuses}
    assert statuses >= {Status.SLOWED_SELF_COLLISION, Status.SLOWED_OBJECT, Status.SLIDING}
    for seed in close[:2]:
        assert walks.walk(seed, 1000, guarded=False).crossed
