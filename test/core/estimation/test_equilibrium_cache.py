# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""First-order changes of an equilibrium between two searches against the equilibria there."""

from dataclasses import replace

from held_grips import APART, BOX, held, HOME
from isotruss_ros.core import Disc
from isotruss_ros.core.estimation.equilibrium_cache import EquilibriumCache
from isotruss_ros.core.holding.roll_grip import roll_grip
import numpy as np
import pytest

FRICTION = 1.3


@pytest.mark.parametrize(('shape', 'angle'), [(Disc(0.4), 0.4), (BOX, 0.0)])
@pytest.mark.parametrize('shifts', [(1e-4, -0.5e-4), (-1e-4, 1e-4)])
def test_slip_margin_after_shifts_is_that_of_the_shifted_equilibrium(shape, angle, shifts):
    grip, shifts = held(shape, angle, APART), np.array(shifts)
    cache, before = EquilibriumCache(grip, FRICTION), grip.slip_margin(FRICTION)
    cache.shift(shifts)
    shifted = replace(grip, anchors=grip.anchors + shifts[grip.contacts.owners])
    change = roll_grip(shifted, HOME).slip_margin(FRICTION) - before
    assert abs(change) > 0.02
    assert cache.margin() - before == pytest.approx(change, rel=0.1)
