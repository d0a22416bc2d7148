# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""One piece of a member against two-node beams between its ends and the places on it."""

from isotruss_ros.core.statics.beam import local_stiffness
from isotruss_ros.core.statics.beam_between import beam_between, BeamPiece
from isotruss_ros.core.statics.clamped_beam import ClampedBeam
import numpy as np
import pytest

LENGTH, AXIAL, FLEXURAL, SHEAR = 0.8, 300.0, 2.0, 40.0
X, Y = 0.3, 0.5


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


@pytest.mark.parametrize('pinned', [False, True])
def test_a_place_gives_as_the_node_of_two_beams(pinned):
    beam = ClampedBeam(LENGTH, AXIAL, FLEXURAL, SHEAR, pinned, 1.0, 1.0)
    for x in (X, Y):
        along, *across = beam.at(x)[20:25]
        expected = respond(pinned, x, x)
        assert along == pytest.approx(expected[0, 0])
        assert np.reshape(across, (2, 2)) == pytest.approx(expected[1:, 1:])


@pytest.mark.parametrize('pinned', [False, True])
@pytest.mark.parametrize(('x', 'y'), [(X, Y), (Y, X)])
def test_another_place_gives_as_the_nodes_of_three_beams(pinned, x, y):
    beam = BeamPiece(LENGTH, AXIAL, FLEXURAL, SHEAR, pinned)
    expected = respond(pinned, x, y)
    assert beam_between(beam, x, y)[0] == pytest.approx(expected, rel=1e-9, abs=1e-12)
