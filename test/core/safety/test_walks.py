"""Random walks of a thousand steps; `python test/helpers/walks.py` walks more."""

from isotruss_ros.core import Status
import pytest
import walks

#: Seeds of walks that come to the bounds, and what each of them must show.
WALKS = {
    0: Status.SLOWED_SELF_COLLISION,
    2: Status.SLIDING,
    12: Status.SLOWED_RIGIDITY,
    15: Status.SLOWED_OBJECT,
    17: Status.SLIDING,
}


@pytest.mark.parametrize('seed', WALKS)
def test_walk_never_crosses_a_bound(seed):
    found = walks.walk(seed, 1000, slide=seed % 3 == 2)
    assert not found.crossed, found
    assert WALKS[seed] in found.statuses


@pytest.mark.parametrize('seed', [0, 2])
def test_walks_cross_a_bound_without_the_guard(seed):
    assert walks.walk(seed, 1000, guarded=False).crossed
