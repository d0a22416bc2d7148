# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A third member that comes to touch, as the structure of the two that hold bends."""

from dataclasses import replace

from held_grips import held, HOME, LOOP, numbers
from isotruss_ros.core import Disc
from isotruss_ros.core.holding.roll_grip import _depth_in
from isotruss_ros.core.model.convex_object import segment_gaps
from isotruss_ros.core.statics.bent_tubes import BentTubes
from isotruss_ros.core.statics.structure import structure_of
import numpy as np
import pytest
from robots import member_ends


@pytest.mark.parametrize(
    ('members', 'diameter', 'other'),
    [
        (LOOP[:2], 0.1, LOOP[2]),
        (LOOP[:2], 0.5, LOOP[2]),
        (('north/P-Z', 'north/Z-R'), 0.3, 'north/R-P'),
        (('south/P-Q', 'north/R-P'), 0.4, 'east/Q-R'),
    ],
)
def test_gap_of_another_member_follows_the_structure(members, diameter, other):
    grip = held(Disc(diameter), 0.0, members, 0.012)
    number = int(numbers([other])[0])
    start, end = member_ends(HOME, other)
    # Where the object is, and close beside the member on its left.
    beside = start + (0.4 + 0.05j) * (end - start)
    for body in (grip.body, grip.body.moved_to((beside.real, beside.imag, 0.0))):
        # Where it is nearest to the object, on a lattice.
        shares = np.linspace(0.0, 1.0, 100001)
        share = shares[np.abs(start + shares * (end - start) - body.middle).argmin()]
        feet = np.append(grip.state.feet, share * abs(end - start))
        loads = np.vstack([grip.state.loads, np.zeros(3)])
        bent = BentTubes(structure_of(HOME), np.append(grip.members, number), feet)
        for _ in range(5):
            bent = bent.update(loads, feet)
        along, across, _ = bent.respond(loads, feet)[-1]
        moved = (along + 1j * across) * bent.axis[-1]
        before, after = (
            segment_gaps(body, np.array([start + by]), np.array([end + by])).gaps[0]
            for by in (0.0, moved)
        )
        deeper = _depth_in(replace(grip, body=body), number, 0.01) - 0.01
        assert deeper == pytest.approx(before - after, rel=0.1)
