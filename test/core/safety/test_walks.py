# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random walks of some hundred steps; `make soak` walks more."""

import os

from isotruss_ros.core import Status
from nightly import some_now
import pytest
import walks

#: Seeds of walks that come to the bounds, with their steps, and what each of them must show.
WALKS = {
    0: (450, Status.SLOWED_SELF_COLLISION),
    12: (1000, Status.SLOWED_RIGIDITY),
    15: (300, Status.SLOWED_OBJECT),
    2: (600, Status.SLIDING),
    17: (600, Status.SLIDING),
    # Its commands at 20 Hz go to and fro beside the bound for seconds.
    30: (280, Status.ACCELERATING),
}


@pytest.mark.parametrize('seed', some_now(WALKS, 3))
def test_walk_never_crosses_a_bound(seed):
    steps, status = WALKS[seed]
    found = walks.walk(seed, steps, slide=seed % 3 == 2)
    assert not found.crossed, found
    assert found.quickest <= walks.ROBOT.description.max_acceleration * (1.0 + 1e-6)
    assert status in found.statuses


@pytest.mark.parametrize('seed', some_now([0, 2]))
def test_walks_cross_a_bound_without_the_guard(seed):
    assert walks.walk(seed, 600, guarded=False).crossed


@pytest.mark.parametrize('seed', some_now([20, 40, 77, 99, 224, 889], 3))
def test_rollers_do_not_chatter_from_beyond_a_bound(seed):
    commands, lost = walks.come_back(seed, steps=20)
    assert commands.any()
    assert walks.reversals(commands) <= walks.EXCHANGE
    assert lost.max() < walks.LOST


@pytest.mark.nightly
@pytest.mark.parametrize('seed', range(int(os.environ.get('WALKS', '3'))))
def test_other_walks_neither_cross_a_bound_nor_chatter(seed):
    found = walks.walk(seed, 1000, slide=seed % 3 == 2)
    assert not found.crossed, found
    assert found.quickest <= walks.ROBOT.description.max_acceleration * (1.0 + 1e-6)
    commands, lost = walks.come_back(seed)
    assert walks.reversals(commands) <= walks.EXCHANGE
    assert lost.max() <= walks.LOST
