# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Plane frames against PyNiteFEA, an independent model, and what every frame obeys."""

from dataclasses import replace
import itertools
import re

import frames
from hypothesis import given
from isotruss_ros.core.errors import IsotrussError, StructureError
import isotruss_ros.core.statics.frame
import numpy as np
import pytest
from robots import examples, generators


def random_case(rng, **options):
    """Return points, members, supports and loads of a frame that stands."""
    points, found, held = frames.random_frame(rng, **options)
    return points, found, held, frames.random_loads(rng, found, len(points))


def random_rows(rng, points, found, held):
    """Return one or two constraints that leave a frame somewhere to go."""
    free = ~held
    free[:, 2] &= frames.turning(found, len(points))
    count = min(int(rng.integers(1, 3)), np.count_nonzero(free) - 1)
    rows = rng.uniform(-1.0, 1.0, (count, free.size))
    # Some displacements count more than others; rotations that are none do not count.
    rows[:, 2::3] *= frames.turning(found, len(points))
    return rows * np.where(rng.random(rows.shape) < 0.5, 1.0, 0.1)


def divided(points, found, rng):
    """Return points and members with every member cut into up to five pieces, and its ends."""
    points, ends, pins, source, outer = list(points), [], [], [], []
    for i in range(len(found.start)):
        start, end = int(found.start[i]), int(found.end[i])
        # No slivers: their stiffness outgrows the others' until rounding eats the difference.
        pieces = rng.uniform(0.2, 1.0, int(rng.integers(1, 6)))
        cuts = np.cumsum(pieces[:-1]) / pieces.sum()
        chain = [start]
        for cut in cuts:
            chain.append(len(points))
            points.append(points[start] + cut * (points[end] - points[start]))
        chain.append(end)
        first = len(ends)
        ends += itertools.pairwise(chain)
        source += [i] * (len(chain) - 1)
        outer.append((first, len(ends) - 1))
        pins += [(first, 0)] * bool(found.pinned_start[i])
        pins += [(len(ends) - 1, 1)] * bool(found.pinned_end[i])
    rigidities = (found.axial[source], found.flexural[source], found.shear[source])
    return np.array(points), frames.members(ends, *rigidities, pins), np.array(outer)


# -- Against others --


@pytest.fixture(params=['dense', 'sparse'])
def path(request, monkeypatch):
    """Solve with dense or with sparse factors, whatever the size."""
    limit = 10**6 if request.param == 'dense' else 0
    monkeypatch.setattr(isotruss_ros.core.statics.frame, 'DENSE_UP_TO', limit)


@pytest.mark.usefixtures('path')
@given(generators())
@examples(30)
def test_constraints_agree_with_an_independent_model(rng):
    points, found, held, loads = random_case(rng)
    rows = random_rows(rng, points, found, held)
    state = frames.frame(points, found, held, rows).solve(loads)
    expected = frames.reference(points, found, held, loads, rows)
    frames.assert_states_agree(state, expected, 1e-8)


@given(generators())
@examples(30)
def test_agrees_with_pynite(rng):
    points, found, held, loads = random_case(rng, shear=False)
    state = frames.frame(points, found, held).solve(loads)
    frames.assert_states_agree(state, frames.pynite(points, found, held, loads), 1e-8)


# -- What every frame obeys --


@given(generators())
@examples(30)
def test_cutting_members_changes_nothing_at_their_ends(rng):
    points, found, held, loads = random_case(rng)
    state = frames.frame(points, found, held).solve(loads)
    more_points, pieces, outer = divided(points, found, rng)
    more = len(more_points) - len(points)
    cut = frames.frame(more_points, pieces, np.pad(held, ((0, more), (0, 0)))).solve(
        np.pad(loads, ((0, more), (0, 0)))
    )
    ends = np.stack([cut.end_forces[outer[:, 0], :3], cut.end_forces[outer[:, 1], 3:]], axis=1)
    cut = replace(
        cut,
        displacements=cut.displacements[: len(points)],
        reactions=cut.reactions[: len(points)],
        end_forces=ends.reshape(-1, 6),
    )
    expected = (state.displacements, state.reactions, state.end_forces)
    frames.assert_states_agree(cut, expected, 1e-9)


@given(generators())
@examples(30)
def test_stiffness_is_symmetric_and_rigid_motion_needs_no_force(rng):
    points, found, held = frames.random_frame(rng)
    stiffness = frames.frame(points, found, held).stiffness.toarray()
    largest = np.abs(stiffness).max()
    assert np.abs(stiffness - stiffness.T).max() < 1e-12 * largest
    assert np.linalg.eigvalsh(stiffness)[0] > -1e-12 * largest
    shift, turn = rng.uniform(-1.0, 1.0, 2), rng.uniform(-1.0, 1.0)
    moved = shift[0] + 1j * shift[1] + 1j * turn * points
    motion = np.stack([moved.real, moved.imag, np.full(len(points), turn)], axis=1).ravel()
    assert np.abs(stiffness @ motion).max() < 1e-12 * largest


# -- Mechanisms --


def moving(points, found, held, rows=None, names=None):
    """Return the names of what moves according to the refusal of a frame."""
    frame = frames.frame(points, found, held, rows, names)
    with pytest.raises(StructureError) as caught:
        frame.solve(np.ones((len(points), 3)))
    assert isinstance(caught.value, IsotrussError)
    said = re.search(r'mechanism: (.*) can move without resistance', str(caught.value))
    assert said, str(caught.value)
    return set(said.group(1).split(', '))


SQUARE = [0.0, 1.0, 1.0 + 1.0j, 1.0j]
RING = [[0, 1], [1, 2], [2, 3], [3, 0]]
PINNED = [(member, end) for member in range(4) for end in (0, 1)]


@pytest.mark.usefixtures('path')
@pytest.mark.parametrize('angle', [0.0, 0.4, np.pi / 2, 2.0])
def test_a_pinned_square_names_its_upper_corners(angle):
    points = np.array(SQUARE) * np.exp(1j * angle)
    held = frames.supports(4, {0: 'xy', 1: 'xy'})
    assert moving(points, frames.members(RING, 1e4, 25.0, 1e3, PINNED), held) == {'n2', 'n3'}
    # One stiff corner, or a diagonal, and it stands.
    stiff = frames.members(RING, 1e4, 25.0, 1e3, PINNED[:3] + PINNED[5:])
    frames.frame(points, stiff, held).solve(np.zeros((4, 3)))
    braced = frames.members([*RING, [0, 2]], 1e4, 25.0, 1e3, [*PINNED, (4, 0), (4, 1)])
    frames.frame(points, braced, held).solve(np.zeros((4, 3)))


@pytest.mark.usefixtures('path')
@pytest.mark.parametrize('held', [{}, {0: 'x'}, {0: 'xy'}, {0: 'y', 1: 'y'}, {2: 'xr'}])
def test_missing_supports_name_all_that_they_would_hold(held):
    found = frames.members(RING, 1e4, 25.0, 1e3)
    names = moving(SQUARE, found, frames.supports(4, held))
    still = {f'n{i}' for i, axes in held.items() if axes == 'xy'}
    # A pinned support stays where it is, but turns.
    assert names | still == {'n0', 'n1', 'n2', 'n3'}


@pytest.mark.usefixtures('path')
def test_a_node_that_nothing_is_connected_to_is_named():
    found = frames.members(RING, 1e4, 25.0, 1e3)
    held = frames.supports(5, {0: 'xy', 1: 'xy'})
    names = ['P', 'Q', 't/P/B', 't/P/C', 'lost']
    assert moving([*SQUARE, 0.5 + 3.0j], found, held, names=names) == {'lost'}


@pytest.mark.usefixtures('path')
@given(generators())
@examples(30)
def test_a_bar_that_hangs_from_one_pin_is_named_at_its_free_end(rng):
    points, found, held, _ = random_case(rng)
    n, k = len(points), len(found.start)
    ends = np.stack([found.start, found.end], axis=1)
    pins = np.stack([found.pinned_start, found.pinned_end], axis=1)
    hung = frames.members(
        [*ends, [int(rng.integers(n)), n]],
        [*found.axial, 1e4],
        [*found.flexural, 25.0],
        [*found.shear, 1e3],
        [*np.argwhere(pins), (k, 0), (k, 1)],
    )
    points = np.append(points, complex(*rng.uniform(3.0, 5.0, 2)))
    assert moving(points, hung, np.pad(held, ((0, 1), (0, 0)))) == {f'n{n}'}


@pytest.mark.usefixtures('path')
@pytest.mark.parametrize('angle', [0.0, np.pi / 2, np.pi, -np.pi / 2, 0.3])
@given(rng=generators())
@examples(10)
def test_a_node_between_two_bars_in_line_is_named(angle, rng):
    # Rounding across the bars once held it up.
    first, last = rng.uniform(0.1, 3.0, 2)
    unit = {0.0: 1.0, np.pi / 2: 1j, np.pi: -1.0, -np.pi / 2: -1j}.get(angle, np.exp(1j * angle))
    rigidities = 10.0 ** rng.uniform([[2.0], [-1.0], [1.0]], [[6.0], [4.0], [6.0]], (3, 2))
    shear = np.inf if rng.random() < 0.5 else rigidities[2]
    found = frames.members([[0, 1], [1, 2]], *rigidities[:2], shear, PINNED[:4])
    points = np.array([0.0, first, first + last]) * unit
    assert moving(points, found, frames.supports(3, {0: 'xy', 2: 'xy'})) == {'n1'}


@pytest.mark.usefixtures('path')
@pytest.mark.parametrize('wobble', [0.0, 1e-16, -1e-13])
def test_a_bar_that_is_nearly_upright_holds_nothing_sideways(wobble):
    # Sideways there is only what rounding leaves. The cantilever beside it stands.
    found = frames.members([[0, 1], [0, 2]], 1e4, 25.0, 1e3, PINNED[:2])
    points = [0.0, 1.0j + wobble, 1.0]
    assert moving(points, found, frames.supports(3, {0: 'xyr', 1: 'y'})) == {'n1'}
    assert moving(points, found, frames.supports(3, {0: 'xyr'})) == {'n1'}


@pytest.mark.usefixtures('path')
def test_a_constraint_can_hold_a_mechanism():
    held = frames.supports(4, {0: 'xy', 1: 'xy'})
    found = frames.members(RING, 1e4, 25.0, 1e3, PINNED)
    row = np.zeros((4, 3))
    row[2, 0] = row[3, 0] = 1.0
    loads = np.zeros((4, 3))
    loads[2, 0] = 1.0
    state = frames.frame(SQUARE, found, held, row.reshape(1, -1)).solve(loads)
    # Half goes through the upper bar, which gives 0.5/EA; its ends share that.
    np.testing.assert_allclose(state.displacements[2:, 0], [0.25e-4, -0.25e-4])


# -- Numbers --


# -- Corners of the interface --


def test_where_all_is_pinned_there_is_no_rotation():
    pins = [(0, 1), (1, 1)]
    found = frames.members([[0, 1], [2, 1]], 1e4, 25.0, 1e3, pins)
    held = frames.supports(3, {0: 'xyr', 2: 'xyr'})
    loads = np.zeros((3, 3))
    loads[1, :2] = 1.0, -2.0
    state = frames.frame([0.0, 1.0, 1.0 + 1.0j], found, held).solve(loads)
    assert state.displacements[1, 2] == 0.0
    np.testing.assert_array_equal(state.end_forces[:, 5], 0.0)


@given(generators())
@examples(10)
def test_compliance_is_the_response_to_unit_loads_on_the_ends_of_members(rng):
    points, found, held, _ = random_case(rng)
    frame = frames.frame(points, found, held)
    chosen = rng.choice(len(found.start), min(2, len(found.start)), replace=False)
    compliance = frame.compliance(chosen)
    assert frame.compliance(chosen) is compliance
    turn = frame.turn[chosen]
    size = 6 * len(chosen)
    expected = np.zeros((size, size))
    for column in range(size):
        member, row = divmod(column, 6)
        pushed = turn[member].T[:, row]
        loads = np.zeros((len(points), 3))
        loads[found.start[chosen[member]]] += pushed[:3]
        loads[found.end[chosen[member]]] += pushed[3:]
        # Where all is pinned, no moment acts on anything.
        loads[~frames.turning(found, len(points)), 2] = 0.0
        moved = frame.solve(loads).displacements
        ends = np.concatenate([moved[found.start[chosen]], moved[found.end[chosen]]], axis=1)
        expected[:, column] = (turn @ ends[:, :, None]).ravel()
    np.testing.assert_allclose(compliance, expected, atol=1e-8 * np.abs(expected).max())


@given(generators())
@examples(10)
def test_end_forces_are_those_of_the_nodes_less_what_members_carry_inside(rng):
    points, found, held, _ = random_case(rng)
    frame = frames.frame(points, found, held)
    # One of them twice: with two loads inside.
    chosen = rng.choice(len(found.start), 3)
    carried = rng.normal(size=(3, 6))
    loads = np.zeros((len(points), 3))
    pushed = (frame.turn[chosen].transpose(0, 2, 1) @ carried[:, :, None])[:, :, 0]
    np.add.at(loads, found.start[chosen], pushed[:, :3])
    np.add.at(loads, found.end[chosen], pushed[:, 3:])
    # Where all is pinned, no moment acts on anything.
    loads[~frames.turning(found, len(points)), 2] = 0.0
    expected = frame.solve(loads).end_forces
    np.subtract.at(expected, chosen, carried)
    forces = frame.end_forces(chosen, carried)
    np.testing.assert_allclose(forces, expected, atol=1e-8 * np.abs(expected).max())


def test_compliance_of_no_members_is_empty():
    points, found, held, _ = random_case(np.random.default_rng(5))
    no_members = np.zeros(0, dtype=np.intp)
    assert frames.frame(points, found, held).compliance(no_members).shape == (0, 0)
