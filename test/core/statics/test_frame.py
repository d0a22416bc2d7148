# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plane frames against PyNiteFEA, an independent model, and what every frame obeys."""

from dataclasses import replace
import re

import frames
from frames import turning
from hypothesis import given
from isotruss_ros.core.errors import IsotrussError, StructureError
from isotruss_ros.core.statics import blocks
from isotruss_ros.core.statics.equilibrium import solve, unloaded
import numpy as np
import pytest
from robots import examples, generators


def pynite(points, found, held, loads):
    """Return what PyNiteFEA says of the frame in space, held in the plane; it knows no shear."""
    package = pytest.importorskip('Pynite', reason='compares with it: pip install PyNiteFEA')
    assert np.isinf(found.section[2]).all()
    model, n = package.FEModel3D(), len(points)
    model.add_material('unit', 1.0, 1.0, 0.3, 1.0)
    still = ~turning(found, n)
    for i, point in enumerate(points):
        model.add_node(f'N{i}', point.real, point.imag, 0.0)
        x, y, turn = held[i].tolist()
        model.def_support(f'N{i}', x, y, True, True, True, bool(turn or still[i]))
        for axis, load in zip(('FX', 'FY', 'MZ'), loads[i].tolist(), strict=True):
            model.add_node_load(f'N{i}', axis, load)
    for i in range(len(found.start)):
        # Out of the plane nothing moves; any Iy and J will do.
        model.add_section(f'S{i}', found.section[0, i], 1.0, found.section[1, i], 1.0)
        model.add_member(f'M{i}', f'N{found.start[i]}', f'N{found.end[i]}', 'unit', f'S{i}')
        model.def_releases(f'M{i}', Rzi=bool(found.pinned[i]))
    model.analyze_linear()
    combo, nodes = 'Combo 1', [model.nodes[f'N{i}'] for i in range(n)]
    moved = np.array([[node.DX[combo], node.DY[combo], node.RZ[combo]] for node in nodes])
    reactions = np.array(
        [[node.RxnFX[combo], node.RxnFY[combo], node.RxnMZ[combo]] for node in nodes]
    )
    forces = []
    for i in range(len(found.start)):
        pushed = model.members[f'M{i}'].F(combo).reshape(2, 6)[:, [0, 1, 5]]
        forces.append(_along(points, found, i, pushed))
    return moved, reactions, np.array(forces)


def _along(points, found, i, pushed):
    """Return end forces (6,) along and across a member from those in the plane (2, 3)."""
    span = points[found.end[i]] - points[found.start[i]]
    local = (pushed[:, 0] + 1j * pushed[:, 1]) * abs(span) / span
    return np.stack([local.real, local.imag, pushed[:, 2]], axis=1).ravel()


def assert_states_agree(state, expected, rtol):
    """Compare displacements, reactions and end forces; lengths, angles, forces, moments apart."""
    pairs = (
        (state.displacements, expected[0]),
        (state.reactions, expected[1]),
        (state.end_forces.reshape(-1, 3), expected[2].reshape(-1, 3)),
    )
    forces = max(np.abs(expected[2]).max(), np.abs(expected[1]).max())
    for (actual, wanted), least in zip(pairs, (0.0, forces, forces), strict=True):
        for columns in ([0, 1], [2]):
            difference = np.abs(actual[:, columns] - wanted[:, columns]).max()
            size = max(np.abs(wanted[:, columns]).max(), least)
            assert difference <= rtol * size, f'{difference} of {size}'


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


# -- Against others --


@pytest.fixture(params=['dense', 'sparse'])
def path(request, monkeypatch):
    """Solve with dense or with sparse factors, whatever the size."""
    limit = 10**6 if request.param == 'dense' else 0
    monkeypatch.setattr(blocks, 'MAX_DENSE_COORDINATES', limit)


@pytest.mark.usefixtures('path')
@given(generators())
@examples(30)
def test_constraints_agree_with_an_independent_model(rng):
    points, found, held, loads = random_case(rng)
    rows = random_rows(rng, points, found, held)
    state = solve(unloaded(frames.frame(points, found, held, rows)), loads)
    expected = frames.reference(points, found, held, loads, rows)
    assert_states_agree(state, expected, 1e-8)


@given(generators())
@examples(30)
def test_agrees_with_pynite(rng):
    points, found, held, loads = random_case(rng, shear=False)
    state = solve(unloaded(frames.frame(points, found, held)), loads)
    assert_states_agree(state, pynite(points, found, held, loads), 1e-8)


@given(generators())
@examples(30)
def test_cutting_members_changes_nothing_at_their_ends(rng):
    points, found, held, loads = random_case(rng)
    frame, count = frames.frame(points, found, held), len(found.start)
    # Some of them twice or more.
    piece = rng.integers(count, size=6)
    cut = frame.cut(piece, frame.length[piece] * rng.uniform(0.1, 0.9, 6))
    state = solve(unloaded(frame), loads)
    parts = solve(unloaded(cut), np.pad(loads, ((0, 6), (0, 0))))
    last = [
        np.flatnonzero((cut.layout.whole == i) & (cut.layout.end == found.end[i]))[0]
        for i in range(count)
    ]
    ends = np.concatenate([parts.end_forces[:count, :3], parts.end_forces[last, 3:]], axis=1)
    same = replace(
        parts,
        displacements=parts.displacements[: len(points)],
        reactions=parts.reactions[: len(points)],
        end_forces=ends,
    )
    expected = (state.displacements, state.reactions, state.end_forces)
    assert_states_agree(same, expected, 1e-8)


# -- Mechanisms --


def moving(points, found, held, rows=None, names=None):
    """Return the names of what moves according to the refusal of a frame."""
    frame = frames.frame(points, found, held, rows, names)
    with pytest.raises(StructureError) as caught:
        unloaded(frame)
    assert isinstance(caught.value, IsotrussError)
    said = re.search(r'mechanism: (.*) can move without resistance', str(caught.value))
    assert said, str(caught.value)
    return set(said.group(1).split(', '))


SQUARE = [0.0, 1.0, 1.0 + 1.0j, 1.0j]
RING = [[0, 1], [1, 2], [2, 3], [3, 0]]
PINNED = [0, 1, 2, 3]


@pytest.mark.usefixtures('path')
@pytest.mark.parametrize('angle', [0.0, 0.4, np.pi / 2, 2.0])
def test_a_pinned_square_names_its_upper_corners_and_the_support_that_turns(angle):
    points = np.array(SQUARE) * np.exp(1j * angle)
    held = frames.supports(4, {0: 'xy', 1: 'xy'})
    assert moving(points, frames.members(RING, 1e4, 25.0, 1e3, PINNED), held) == {'n0', 'n2', 'n3'}
    # One stiff corner, or a diagonal, and it stands.
    stiff = frames.members(RING, 1e4, 25.0, 1e3, [0, 1, 3])
    unloaded(frames.frame(points, stiff, held))
    braced = frames.members([*RING, [0, 2]], 1e4, 25.0, 1e3, [*PINNED, 4])
    unloaded(frames.frame(points, braced, held))


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
@pytest.mark.parametrize('angle', [0.0, np.pi / 2, np.pi, -np.pi / 2, 0.3])
@given(rng=generators())
@examples(10)
def test_a_node_between_two_bars_in_line_is_named(angle, rng):
    # Rounding across the bars once held it up.
    first, last = rng.uniform(0.1, 3.0, 2)
    unit = {0.0: 1.0, np.pi / 2: 1j, np.pi: -1.0, -np.pi / 2: -1j}.get(angle, np.exp(1j * angle))
    rigidities = 10.0 ** rng.uniform([[2.0], [-1.0], [1.0]], [[6.0], [4.0], [6.0]], (3, 2))
    shear = np.inf if rng.random() < 0.5 else rigidities[2]
    found = frames.members([[0, 1], [1, 2]], *rigidities[:2], shear, [0, 1])
    points = np.array([0.0, first, first + last]) * unit
    assert moving(points, found, frames.supports(3, {0: 'xy', 2: 'xy'})) == {'n1', 'n2'}


@pytest.mark.usefixtures('path')
def test_a_constraint_can_hold_a_mechanism():
    held = frames.supports(4, {0: 'xy', 1: 'xy'})
    found = frames.members(RING, 1e4, 25.0, 1e3, PINNED)
    row = np.zeros((4, 3))
    row[2, 0] = row[3, 0] = 1.0
    loads = np.zeros((4, 3))
    loads[2, 0] = 1.0
    state = solve(unloaded(frames.frame(SQUARE, found, held, row.reshape(1, -1))), loads)
    # Half goes through the upper bar, which gives 0.5/EA; its ends share that.
    np.testing.assert_allclose(state.displacements[2:, 0], [0.25e-4, -0.25e-4])
