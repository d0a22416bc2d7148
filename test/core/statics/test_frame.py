# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames bent against OpenSees, and the robot against equation (4), written from the paper."""

import ctypes
import importlib.util
import itertools
from pathlib import Path
import re

import frames
from hypothesis import assume, given
from hypothesis import strategies as st
from isotruss_ros import core
from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.statics.frame import BeamColumns
from isotruss_ros.core.statics.tangent import bend, follow_loads, solve, unloaded
from isotruss_ros.core.statics.tube_stiffness import tube_stiffness
import numpy as np
import pytest
import robots
from robots import examples, generators, PRESETS


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
    points, bars, held = frames.random_frame(rng)
    held[:, 2] |= ~frames.turning(bars, len(points))
    loads = np.where(held, 0.0, rng.uniform(-10.0, 10.0, held.shape))
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


def visits(description):
    """Return (tube, joint, next joint, joint before) of each module, in order."""
    return [
        (tube.name, joint, tube.joints[(i + 1) % len(tube.joints)], tube.joints[i - 1])
        for tube in description.tubes
        for i, joint in enumerate(tube.joints)
    ]


def places(config):
    """Return the positions of all nodes by name: those of the configuration, and D and E."""
    description = config.robot.description
    points = dict(zip(config.robot.node_names, config.points.tolist(), strict=True))
    ring = description.module.guide_ring_distance
    for tube, joint, ahead, behind in visits(description):
        b, c = points[f'{tube}/{joint}/B'], points[f'{tube}/{joint}/C']
        to_next, to_previous = points[f'{tube}/{ahead}/C'] - b, points[f'{tube}/{behind}/B'] - c
        points[f'{tube}/{joint}/D'] = b + ring * to_next / abs(to_next)
        points[f'{tube}/{joint}/E'] = c + ring * to_previous / abs(to_previous)
    return points


def bisection(a, b, c, d, e):
    """Return the difference of the angles of (3)."""
    rod = 0.5 * (b + c) - a

    def angle(v):
        cross = rod.real * v.imag - rod.imag * v.real
        return np.arctan2(abs(cross), rod.real * v.real + rod.imag * v.imag)

    return angle(d - b) - angle(e - c)


def gradient(points):
    """Return the derivative (5, 2) of the bisection by x and y of A, B, C, D and E."""
    slopes = np.zeros((5, 2))
    for i in range(5):
        for axis, unit in enumerate((1.0, 1j)):
            moved = np.array([points, points])
            moved[:, i] += [1e-5 * unit, -1e-5 * unit]
            slopes[i, axis] = (bisection(*moved[0]) - bisection(*moved[1])) / 2e-5
    return slopes


def from_scratch(config):
    """Return names, points, members (AB, AC, BC, BD, CE, DE), supports and rows as in Fig. 1b."""
    description = config.robot.description
    points = places(config)
    names = list(points)
    number = {name: i for i, name in enumerate(names)}
    lengths = dict(zip(config.robot.member_names, config.member_lengths, strict=True))
    ends, rigidities, pins, rows = [], [], [], []

    def add(start, end, values, pinned):
        pins.extend([len(ends)] * pinned)
        ends.append((number[start], number[end]))
        rigidities.append(values)

    def tube_values(member):
        sections = tube_stiffness(description).section_stiffness(
            [lengths[member]], description.pressures[member.split('/')[0]]
        )
        return sections.axial[0], sections.flexural[0], sections.shear[0]

    hard = (description.module.axial_rigidity, description.module.flexural_rigidity, np.inf)
    for tube, joint, ahead, behind in visits(description):
        module = f'{tube}/{joint}'
        b, c, d, e = (f'{module}/{node}' for node in 'BCDE')
        leaving, entering = f'{module}-{ahead}', f'{tube}/{behind}-{joint}'
        add(joint, b, hard, True)
        add(joint, c, hard, True)
        add(b, c, hard, False)
        add(b, d, tube_values(leaving), True)
        add(c, e, tube_values(entering), True)
        add(d, f'{tube}/{ahead}/E', tube_values(leaving), False)
        row = np.zeros((len(names), 3))
        nodes = [joint, b, c, d, e]
        row[[number[node] for node in nodes], :2] = gradient([points[node] for node in nodes])
        rows.append(row.ravel())
    supported = {number[joint]: axes for joint, axes in description.supports.items()}
    held = frames.supports(len(names), supported)
    bars = frames.members(ends, *np.array(rigidities).T, pins)
    return names, np.array(list(points.values())), bars, held, np.array(rows)


def random_loads(rng, robot):
    """Return loads on some of the joints; at least one of these can move."""
    joints = list(robot.description.joints)
    chosen = set(rng.choice(joints, int(rng.integers(0, len(joints))), replace=False).tolist())
    held = robot.description.supports
    chosen.add(rng.choice([joint for joint in joints if len(held.get(joint, ())) < 2]).item())
    return {joint: rng.uniform(-20.0, 20.0, 2) for joint in joints if joint in chosen}


def cases():
    """Return a strategy of configurations of presets and random robots, with loads."""

    def case(robot, rng):
        return robots.random_state(robot, rng), random_loads(rng, robot)

    return st.builds(
        case,
        st.one_of(st.sampled_from(PRESETS).map(core.load_robot), robots.robots()),
        generators(),
    )


@given(cases())
@examples(30)
def test_agrees_with_the_system_of_the_paper(case):
    config, joint_loads = case
    names, points, bars, held, rows = from_scratch(config)
    loads = np.zeros((len(names), 3))
    for joint, force in joint_loads.items():
        loads[names.index(joint), :2] = force
    moved, reactions, forces = frames.reference(points, bars, held, loads, rows)
    deformation = core.deform(config, joint_loads, paper_model=True)
    actual = np.array([deformation.displacement(name) for name in names])
    for columns in ([0, 1], [2]):
        difference = np.abs(actual - moved)[:, columns].max()
        assert difference < 1e-7 * np.abs(moved[:, columns]).max()
    largest = max(np.abs(reactions).max(), np.abs(forces).max())
    assert set(deformation.reactions) == set(config.robot.description.supports)
    for joint, reaction in deformation.reactions.items():
        expected = reactions[names.index(joint)]
        np.testing.assert_allclose([*reaction, 0.0], expected, atol=1e-7 * largest)
    # Every sixth member is a long piece DE'.
    pieces = deformation.state.end_forces[deformation.structure.pieces[2]]
    np.testing.assert_allclose(pieces, forces[5::6], atol=1e-7 * largest)


def test_pressure_may_be_one_for_all_one_for_each_or_by_tube():
    config = core.load_robot('nine_member').home
    loads = {'Z': (0.0, -10.0)}
    pressures = {'file': None, 'same': 34.5e3, 'mapping': {'north': 34500}, 'low': 17e3}
    pressures |= {'north': {'north': 17e3}, 'order': [34.5e3, 34.5e3, 17e3]}
    sink = {
        name: core.deform(config, loads, pressure).displacement('Z')[1]
        for name, pressure in pressures.items()
    }
    assert sink['file'] == sink['same'] == sink['mapping']
    assert sink['north'] == sink['order']
    assert sink['low'] < sink['north'] < sink['file'] < 0.0


def test_displacements_of_unknown_nodes_are_refused_by_name():
    deformation = core.deform(core.load_robot('triangle').home, {'T': (0.0, -1.0)})
    with pytest.raises(StructureError, match=r'main/T/b.*t/j/D'):
        deformation.displacement('main/T/b')
