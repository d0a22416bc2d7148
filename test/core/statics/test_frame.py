# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plane frames, straight against a model of their own and bent against OpenSees."""

import ctypes
import importlib.util
import itertools
from pathlib import Path
import re

import frames
from hypothesis import assume, given
from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.statics.beam_column import BeamColumns
from isotruss_ros.core.statics.equilibrium import bend, follow_loads, solve, unloaded
import numpy as np
import pytest
from robots import examples, generators


def moving(points, bars, held):
    """Return the names of what moves according to the refusal of a frame."""
    frame = frames.frame(points, bars, held)
    with pytest.raises(StructureError) as caught:
        unloaded(frame)
    names = re.search(r'mechanism: (.*) can move without resistance', str(caught.value))
    return set(names.group(1).split(', '))


SQUARE = [0.0, 1.0, 1.0 + 1.0j, 1.0j]
RING = [[0, 1], [1, 2], [2, 3], [3, 0]]
PINNED = [0, 1, 2, 3]


@pytest.mark.parametrize('angle', [0.0, 0.4])
def test_a_pinned_square_names_its_upper_corners_and_the_support_that_turns(angle):
    points = np.array(SQUARE) * np.exp(1j * angle)
    held = frames.supports(4, {0: 'xy', 1: 'xy'})
    assert moving(points, frames.members(RING, 1e4, 25.0, 1e3, PINNED), held) == {'n0', 'n2', 'n3'}
    # One stiff corner, or a diagonal, and it stands.
    stiff = frames.members(RING, 1e4, 25.0, 1e3, [0, 1, 3])
    unloaded(frames.frame(points, stiff, held))
    braced = frames.members([*RING, [0, 2]], 1e4, 25.0, 1e3, [*PINNED, 4])
    unloaded(frames.frame(points, braced, held))


@pytest.mark.parametrize('angle', [0.0, np.pi / 2, 0.3])
@given(rng=generators())
@examples(10)
def test_a_node_between_two_bars_in_line_is_named(angle, rng):
    # Rounding across the bars once held it up.
    first, last = rng.uniform(0.1, 3.0, 2)
    unit = {0.0: 1.0, np.pi / 2: 1j}.get(angle, np.exp(1j * angle))
    rigidities = 10.0 ** rng.uniform([[2.0], [-1.0], [1.0]], [[6.0], [4.0], [6.0]], (3, 2))
    shear = np.inf if rng.random() < 0.5 else rigidities[2]
    bars = frames.members([[0, 1], [1, 2]], *rigidities[:2], shear, [0, 1])
    points = np.array([0.0, first, first + last]) * unit
    assert moving(points, bars, frames.supports(3, {0: 'xy', 2: 'xy'})) == {'n1', 'n2'}


#: What its shared object needs, from its own wheel.
LIBRARIES = ('quadmath.so.0', 'gfortran.so.4', 'gomp.so.1', 'blas.so.3', 'lapack.so.3')


def load_opensees():
    """Return the program, or skip the test where it is not installed."""
    bars = importlib.util.find_spec('openseespylinux')
    if bars is None:
        pytest.skip('compares with it: pip install openseespylinux')
    folder = Path(bars.submodule_search_locations[0]) / 'lib'
    for name in LIBRARIES:
        ctypes.CDLL(str(folder / f'lib{name}'), mode=ctypes.RTLD_GLOBAL)
    from openseespylinux import opensees

    return opensees


def bend_by_opensees(points, bars, held, loads):
    """Return large displacements (n, 3) of the nodes, by chains of Timoshenko beams."""
    ops, n, parts, steps = load_opensees(), len(points), 8, 4
    ops.wipe()
    ops.model('basic', '-ndm', 2, '-ndf', 3)
    ops.geomTransf('Corotational', 1)
    for i, point in enumerate(points.tolist()):
        ops.node(i, point.real, point.imag)
        ops.fix(i, *(int(flag) for flag in held[i]))
    count = n
    for k in range(len(bars.start)):
        ends = int(bars.start[k]), int(bars.end[k])
        chain = []
        for end, pinned in zip(ends, (bars.pinned[k], False), strict=True):
            if pinned:
                ops.node(count, points[end].real, points[end].imag)
                ops.fix(count, *(int(flag) for flag in held[end, :2]), 0)
                free = (1 + np.flatnonzero(~held[end, :2])).tolist()
                if free:
                    ops.equalDOF(end, count, *free)
            chain.append(count if pinned else end)
            count += bool(pinned)
        inner = np.linspace(points[ends[0]], points[ends[1]], parts + 1)[1:-1]
        for place in inner.tolist():
            ops.node(count, place.real, place.imag)
            chain.insert(-1, count)
            count += 1
        axial, flexural, shear = bars.section[:, k].tolist()
        # E = G = 1: areas and moments of area are rigidities.
        ops.section('Elastic', k + 1, 1.0, axial, flexural, 1.0, shear / axial)
        ops.beamIntegration('Lobatto', k + 1, k + 1, 3)
        for i, pair in enumerate(itertools.pairwise(chain)):
            ops.element('forceBeamColumn', parts * k + i, *pair, 1, k + 1)
    ops.timeSeries('Linear', 1)
    ops.pattern('Plain', 1, 1)
    for i, load_ in enumerate(loads.tolist()):
        ops.load(i, *load_)
    ops.constraints('Transformation')
    ops.numberer('RCM')
    ops.system('UmfPack')
    ops.test('NormDispIncr', 1e-10, 50)
    ops.algorithm('Newton')
    ops.integrator('LoadControl', 1.0 / steps)
    ops.analysis('Static')
    assert ops.analyze(steps) == 0
    return np.array([ops.nodeDisp(i) for i in range(n)])


#: Largest displacement of the linear frame [m], and what the bent one differs from it at most.
DISPLACEMENT, NONLINEAR = 0.04, 0.1


def bent_case(rng):
    """Return a frame of tubes under loads that bend it by centimetres, and how it bends."""
    points, bars, held = frames.random_frame(rng, spread=0.3)
    held[:, 2] |= ~frames.turning(bars, len(points))
    loads = np.where(held, 0.0, frames.random_loads(rng, bars, len(points)))
    frame = frames.frame(points, bars, held)
    rest = unloaded(frame)
    linear = solve(rest, loads).displacements[:, :2]
    size = DISPLACEMENT / max(np.abs(linear).max(), 1e-9)
    assume(0.1 < size < 10.0)
    bent = bend(rest, size * loads)
    assume(bent is not None)
    # Near a limit load displacements are any.
    assume(follow_loads(rest, 2.0 * size * loads, 1.0).factors[-1] == 1.0)
    off = np.abs(bent.displacements[:, :2] - size * linear).max()
    assume(off < NONLINEAR * DISPLACEMENT)
    # The beam-columns are expanded to the second power of the axial forces, relative to this.
    length = np.abs(points[bars.end] - points[bars.start])
    limits = 4.0 * bars.section[1] / length**2
    assume((np.abs(bent.forces.values[:, 0]) < limits).all())
    return frame, bars, held, size * loads, bent


@given(generators())
@examples(20)
def test_bent_frames_agree_with_opensees(rng):
    frame, bars, held, loads, bent = bent_case(rng)
    expected = bend_by_opensees(frame.points, bars, held, loads)
    off = np.abs(bent.displacements - expected)[:, :2].max()
    linear = np.abs(solve(unloaded(frame), loads).displacements - expected)[:, :2].max()
    assert off < max(3e-3 * np.abs(expected[:, :2]).max(), 0.2 * linear)


@pytest.mark.parametrize('shear', [np.inf, 1.9e3])
@pytest.mark.parametrize('share', [-0.3, 0.3])
def test_stiffness_of_a_bent_member_is_that_of_the_stability_functions(share, shear):
    length, flexural = 0.5, 25.0
    axial = share * 4.0 * flexural / length**2
    section = np.array([[1e7], [flexural], [shear]])
    member = BeamColumns.of(np.array([length]), section, np.array([False]))
    bent = member.evaluate(np.zeros(1), np.zeros((2, 1)), np.array([axial]))
    phase = np.emath.sqrt(-share / (1.0 + axial / shear))
    ratio = (phase / np.tan(phase)).real
    softening = 12.0 * flexural / (shear * length**2) + (3.0 * (1.0 - ratio) / phase**2).real
    # Of an S, and of a bow.
    stiffness = 4.0 * flexural / length * np.array([3.0 / softening, ratio])
    assert bent.stiffness[0].diagonal()[1:] == pytest.approx(stiffness, rel=1e-3)
    # With a pinned start, both moments are that of the end: flexibilities add up.
    pinned = BeamColumns.of(np.array([length]), section, np.array([True]))
    bent = pinned.evaluate(np.zeros(1), np.zeros((2, 1)), np.array([axial]))
    assert bent.stiffness[0, 1, 1] == pytest.approx(1.0 / (1.0 / stiffness).sum(), rel=1.5e-3)


@pytest.mark.parametrize('shear', [np.inf, 1.9e3])
def test_a_column_buckles_at_the_load_of_engesser(shear):
    length, flexural, parts = 2.0, 25.0, 8
    points = np.linspace(0.0, length, parts + 1)
    ends = np.stack([np.arange(parts), np.arange(1, parts + 1)], axis=1)
    bars = frames.members(ends, 1e7, flexural, shear, [0])
    held = frames.supports(parts + 1, {0: 'xyr', parts: 'y'})
    loads = np.zeros((parts + 1, 3))
    loads[parts, 0] = -1.0
    euler = np.pi**2 * flexural / length**2
    path = follow_loads(unloaded(frames.frame(points, bars, held)), loads, 2.0 * euler)
    assert path.limit == pytest.approx(euler / (1.0 + euler / shear), rel=2e-3)
