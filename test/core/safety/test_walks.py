"""Random walks of some hundred steps; `python test/helpers/walks.py` walks more."""

from isotruss_ros.core import Status
import pytest
import walks

#: Seeds of walks that come to the bounds, with their steps, and what each of them must show.
WALKS = {
    0: (600, Status.SLOWED_SELF_COLLISION),
    2: (600, Status.SLIDING),
    12: (1000, Status.SLOWED_RIGIDITY),
    15: (600, Status.SLOWED_OBJECT),
    17: (600, Status.SLIDING),
}


@pytest.mark.parametrize('seed', WALKS)
def test_walk_never_crosses_a_bound(seed):
    steps, status = WALKS[seed]
    found = walks.walk(seed, steps, slide=seed % 3 == 2)
    assert not found.crossed, found
    assert status in found.statuses


@pytest.mark.parametrize('seed', [0, 2])
def test_walks_cross_a_bound_without_the_guard(seed):
    assert walks.walk(seed, 600, guarded=False).crossed
