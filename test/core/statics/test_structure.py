# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The robot as a frame against the system of equation (4), written down here from the paper."""

import frames
from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core import deform, load_robot
from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.statics.tube_stiffness import tube_stiffness
import numpy as np
import pytest
import robots
from robots import examples, generators, PRESETS


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
        case, st.one_of(st.sampled_from(PRESETS).map(load_robot), robots.robots()), generators()
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
    deformation = deform(config, joint_loads, paper_model=True)
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
    config = load_robot('nine_member').home
    loads = {'Z': (0.0, -10.0)}
    pressures = {'file': None, 'same': 34.5e3, 'mapping': {'north': 34500}, 'low': 17e3}
    pressures |= {'north': {'north': 17e3}, 'order': [34.5e3, 34.5e3, 17e3]}
    sink = {
        name: deform(config, loads, pressure).displacement('Z')[1]
        for name, pressure in pressures.items()
    }
    assert sink['file'] == sink['same'] == sink['mapping']
    assert sink['north'] == sink['order']
    assert sink['low'] < sink['north'] < sink['file'] < 0.0


def test_displacements_of_unknown_nodes_are_refused_by_name():
    deformation = deform(load_robot('triangle').home, {'T': (0.0, -1.0)})
    with pytest.raises(StructureError, match=r'main/T/b.*t/j/D'):
        deformation.displacement('main/T/b')
