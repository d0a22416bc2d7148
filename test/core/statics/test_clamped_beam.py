# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What loads at places of a beam do there, against two-node beams between places and ends."""

from hypothesis import given, strategies
from isotruss_ros.core.statics.beam import local_stiffness
from isotruss_ros.core.statics.interior import ClampedBeam
import numpy as np
import pytest
import robots

LENGTH, AXIAL, FLEXURAL, SHEAR = 0.8, 300.0, 2.0, 40.0
STEP = 1e-6

places = strategies.integers(1, 15).map(lambda i: 0.05 * i)


def respond(pinned, x, y):
    """Return displacement along and across and mean slope at x by unit loads at y, (3, 3)."""
    places = sorted({0.0, x, y, LENGTH})
    count, here, there = len(places), places.index(x), places.index(y)
    one = np.ones(count - 1)
    beams = local_stiffness(np.diff(places), AXIAL * one, FLEXURAL * one, SHEAR * one)
    stiffness = np.zeros((3 * count, 3 * count))
    # Displacements along and across and the rotation, of both ends of each beam.
    ends = [np.arange(3 * i, 3 * i + 6) for i in range(len(beams))]
    for beam, end in zip(beams, ends, strict=True):
        stiffness[np.ix_(end, end)] += beam
    free = np.arange(2 if pinned else 3, 3 * count - 3)
    moved = np.zeros((3 * count, 3))
    loads = np.eye(3 * count)[:, 3 * there + np.arange(3)]
    moved[free] = np.linalg.solve(stiffness[np.ix_(free, free)], loads[free])
    # The shear force before and behind the place leans the line against the sections.
    sheared = [(beams[i] @ moved[ends[i]])[4] / SHEAR for i in (here - 1, here)]
    own = moved[3 * here + np.arange(3)]
    return np.array([own[0], own[1], own[2] + 0.5 * sum(sheared)])


@robots.examples(100)
@given(strategies.booleans(), places, places)
def test_loads_do_what_they_do_at_the_nodes_of_a_cut_beam(pinned, x, y):
    along, *across = ClampedBeam(LENGTH, AXIAL, FLEXURAL, SHEAR, pinned).influence(x, y)[:5]
    expected = respond(pinned, x, y)
    assert along == pytest.approx(expected[0, 0], rel=1e-9)
    assert across == pytest.approx(expected[1:, 1:].ravel(), rel=1e-9, abs=1e-12)


@robots.examples(100)
@given(strategies.booleans(), places, places)
def test_rates_are_those_of_differences(pinned, x, y):
    beam = ClampedBeam(LENGTH, AXIAL, FLEXURAL, SHEAR, pinned)
    _, by_x, by_y = np.reshape(beam.influence(x, y), (3, 5))
    # At one place the slope has a kink, and what both places do together has a derivative.
    moves = [(1.0, 1.0, by_x + by_y)]
    moves += [(1.0, 0.0, by_x), (0.0, 1.0, by_y)] if x != y else []
    for dx, dy, expected in moves:
        ahead, back = (
            np.array(beam.influence(x + sign * dx, y + sign * dy)[:5]) for sign in (STEP, -STEP)
        )
        assert (ahead - back) / (2.0 * STEP) == pytest.approx(expected, rel=1e-5, abs=1e-8)
