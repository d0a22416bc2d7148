# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Points inside members: against members that are cut there, and against what is known."""

from hypothesis import given, strategies
from isotruss_ros.core.statics.beam import Beams
import numpy as np
import pytest
import robots
import tubes

generators = robots.generators()
pins = strategies.booleans()


def random_points(rng, members, points, pinned=None):
    """
    Return points on members of any rigidities, one of three without shear deformation.

    Members and places; then lengths, rigidities and pins, as `Beams` takes them.
    """
    length = rng.uniform(0.1, 3.0, members)
    member = rng.integers(members, size=points)
    # Apart, so that the member that is cut there is well-conditioned.
    shares = (rng.permutation(points) + rng.uniform(0.3, 0.7, points)) / points
    return (
        member,
        length[member] * shares,
        length,
        10.0 ** rng.uniform(2.0, 6.0, members),
        10.0 ** rng.uniform(0.0, 4.0, members),
        np.where(rng.random(members) < 1 / 3, np.inf, 10.0 ** rng.uniform(2.0, 6.0, members)),
        rng.random(members) < 0.5 if pinned is None else np.full(members, pinned),
    )


def cut(drawn, number):
    """Return the points of a member, and its stiffness with nodes there."""
    member, place, *beams, pinned = drawn
    here = np.flatnonzero(member == number)
    here = here[np.argsort(place[here])]
    values = (each[number] for each in beams)
    return here, tubes.cut_member(*values, (pinned[number], False), place[here])


def parts(matrix):
    """Return the coupling of inner nodes to the ends, and their own stiffness."""
    size = len(matrix)
    inner = np.arange(3, size - 3)
    ends = np.setdiff1d(np.arange(size), inner)
    return matrix[np.ix_(inner, ends)], matrix[np.ix_(inner, inner)]


@robots.examples(100)
@given(generators, pins)
def test_shapes_are_those_of_a_member_cut_at_the_points(rng, pinned):
    drawn = random_points(rng, 3, 12, pinned)
    shapes, _ = Beams(*drawn[2:]).points(*drawn[:2])
    assert shapes.shape == (12, 2, 6)
    for member in range(3):
        here, matrix = cut(drawn, member)
        coupling, own = parts(matrix)
        if len(here) == 0:
            continue
        expected = -np.linalg.solve(own, coupling).reshape(-1, 3, 6)[:, :2]
        assert shapes[here] == pytest.approx(expected, rel=1e-8, abs=1e-8)


@robots.examples(100)
@given(generators, pins)
def test_compliance_is_that_of_a_member_cut_at_the_points(rng, pinned):
    drawn = random_points(rng, 3, 12, pinned)
    _, compliance = Beams(*drawn[2:]).points(*drawn[:2])
    assert compliance.shape == (2, 12, 12)
    assert (compliance[:, drawn[0][:, None] != drawn[0]] == 0.0).all()
    for member in range(3):
        here, matrix = cut(drawn, member)
        if len(here) == 0:
            continue
        own = np.linalg.inv(parts(matrix)[1])
        own = own.reshape(len(here), 3, len(here), 3)
        for axis in range(2):
            expected = own[:, axis, :, axis]
            found = compliance[axis][np.ix_(here, here)]
            assert found == pytest.approx(expected, rel=1e-7, abs=1e-9 * expected.max())
