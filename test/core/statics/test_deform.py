# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The robot deformed by loads: its limit load, utilisation, and loads on modules and tubes."""

import contextlib

from isotruss_ros.core import deform, load_robot
from isotruss_ros.core.errors import ConfigurationError, SolverError, StructureError
from isotruss_ros.core.statics.bent_tubes import BentTubes
from isotruss_ros.core.statics.equilibrium import follow_loads
from isotruss_ros.core.statics.structure import structure_of
import numpy as np
import pytest
import robots

TRIANGLE = load_robot('triangle').home
LEG = 'main/R-T'


def test_beyond_the_limit_load_the_error_names_it():
    limit = deform(TRIANGLE, {'T': (0.0, -100.0)}).limit_factor()
    assert deform(TRIANGLE, {'T': (0.0, -99.0 * limit)}).displacement('T')[1] < 0.0
    with pytest.raises(StructureError, match=r'unstable at 0\.5\d* times these loads'):
        deform(TRIANGLE, {'T': (0.0, -190.0 * limit)})


def near_the_end_of_the_shapes(seed):
    """Return a random robot, far on a random way of its rollers, and a force on a joint."""
    rng, robot = np.random.default_rng(seed), robots.random_robot(seed)
    size, reached = robot.home.member_lengths.min(), 0.0
    way = rng.uniform(-size, size, len(robot.roller_names))
    for share in 0.5 ** np.arange(1, 9):
        with contextlib.suppress(ConfigurationError):
            robot.configuration((reached + share) * way)
            reached += share
    joint = str(rng.choice(list(robot.description.joints)))
    force = rng.uniform(-1.0, 1.0, 2) * 10.0 ** rng.uniform(0.0, 2.0)
    return robot.configuration(reached * way), joint, force


# Newton's method alone finds a stable state beyond a limit load at the first three.
@pytest.mark.parametrize('seed', [39, 204, 315, *range(5)])
def test_a_state_beyond_a_limit_load_that_small_steps_do_not_reach_is_refused(seed):
    config, joint, force = near_the_end_of_the_shapes(seed)
    structure = structure_of(config)
    loads = np.zeros((len(structure.node_names), 3))
    loads[structure.node(joint), :2] = force
    straight, _ = structure.unloaded
    path = follow_loads(straight, loads, 1.0)
    if path.factors[-1] < 1.0:
        with pytest.raises(StructureError, match='beyond the limit load'):
            deform(config, {joint: force})
    else:
        found = deform(config, {joint: force}).state.displacements
        assert found == pytest.approx(path.tangents[-1].displacements, abs=1e-7)


def test_a_limit_load_farther_than_the_search_goes_is_an_error():
    rng, robot = np.random.default_rng(80), robots.random_robot(80)
    joint = str(rng.choice(list(robot.description.joints)))
    found = deform(robot.home, {joint: rng.uniform(-20.0, 20.0, 2)})
    with pytest.raises(SolverError, match=r'no limit load up to \S+ times these loads'):
        found.limit_factor()


def test_a_load_that_stretches_no_column_has_no_limit_nearby():
    assert deform(TRIANGLE, {'T': (0.0, 0.1)}).limit_factor() == np.inf


def test_compression_amplifies_moments_inside_a_member():
    load = {'T': (0.0, -150.0)}
    bent, linear = (deform(TRIANGLE, load, paper_model=paper) for paper in (False, True))
    assert bent.utilisation[LEG] > 1.2 * linear.utilisation[LEG]
    # At its ends, the moment of the bent leg is less than inside it.
    structure = bent.structure
    ends = bent.state.end_forces[structure.pieces[2]][
        structure.config.robot.member_names.index(LEG)
    ]
    radius = 0.5 * structure.config.robot.description.tube_diameter
    wall = np.pi * radius**2 * structure.pressures[0]
    at_ends = max(abs(ends[2]), abs(ends[5])) / (0.5 * radius * (wall - ends[0]))
    assert bent.utilisation[LEG] > 1.01 * at_ends


def test_a_force_on_a_module_acts_in_the_middle_of_its_pinch_points():
    found = deform(TRIANGLE, {}, module_loads={'main/T': (0.0, -1.0, 0.5)}, paper_model=True)
    halves = found.loads[[found.structure.node(f'main/T/{node}') for node in 'BC']]
    assert halves == pytest.approx(np.array([[0.0, -0.5, 0.25]] * 2))
    # The supports bear the force and its moment about them.
    reactions = np.array(list(found.reactions.values()))
    assert reactions.sum(axis=0) == pytest.approx([0.0, 1.0], abs=1e-9)


@pytest.mark.parametrize('apart', [0.0, 1e-9, 1e-7])
def test_loads_at_one_place_of_a_tube_act_as_their_sum(apart):
    two = [(0.6, 2.0, 0.0, 0.0), (0.6 + apart, 0.0, 3.0, 0.1)]
    both, found = (
        deform(TRIANGLE, {}, tube_loads={LEG: loads}).displacement('T')
        for loads in ([(0.6, 2.0, 3.0, 0.1)], two)
    )
    assert found == pytest.approx(both, rel=1e-6)


@pytest.mark.parametrize('end', ['start', 'end'])
def test_a_force_at_an_end_of_a_tube_is_that_of_a_place_nearby(end):
    length = TRIANGLE.member_lengths[1]
    places = [1e-300, 1e-5] if end == 'start' else [np.nextafter(length, 0.0), length - 1e-5]
    there, nearby = (
        deform(TRIANGLE, {}, tube_loads={LEG: [(at, 2.0, 3.0, 0.0)]}).displacement('T')
        for at in places
    )
    assert there == pytest.approx(nearby, rel=1e-3)


@pytest.mark.parametrize(
    ('loads', 'complaint'),
    [
        ({'joint_loads': {'W': (0.0, -1.0)}}, "joint 'W': robot triangle .*L, R, T"),
        ({'joint_loads': {None: (0.0, -1.0)}}, "joint 'None': robot triangle"),
        ({'joint_loads': {'T': (np.nan, 0.0)}}, 'joint T.*must be 2 finite numbers'),
        ({'joint_loads': {'T': (1.7e308, 0.0)}}, r'joint T: .*at most 1e\+06'),
        ({'module_loads': {'main/W': (0.0, 0.0, 1.0)}}, "module 'main/W'.*main/L, main/R, main/T"),
        ({'tube_loads': {'main/W': [(0.1, 0.0, 0.0, 1.0)]}}, "member 'main/W'.*main/R-T"),
        ({'tube_loads': {LEG: [(9.0, 0.0, 0.0, 1.0)]}}, 'at 9 m of member .*must be between'),
        ({'tube_loads': {LEG: [(0.4, np.nan, 0.0, 1.0)]}}, 'must be 4 finite numbers'),
    ],
)
def test_invalid_loads_are_refused(loads, complaint):
    with pytest.raises(StructureError, match=complaint):
        deform(TRIANGLE, **{'joint_loads': {}, **loads})


@pytest.mark.parametrize('away', [-4e-4, -1e-6, 0.0, 1e-9, 1e-6, 4e-4])
def test_tubes_with_a_load_beside_a_guide_ring_bend_as_the_robot_does(away):
    place = np.array([TRIANGLE.robot.description.module.guide_ring_distance + away])
    member = np.array([TRIANGLE.robot.member_names.index(LEG)])
    tubes = BentTubes.of(structure_of(TRIANGLE), member, place)
    load = np.array([[10.0, 40.0, 1.0]])
    x, y = (tubes.lines.axis * (10.0 + 40.0j)).view(float)
    wanted = deform(TRIANGLE, {}, tube_loads={LEG: [(place[0], x, y, 1.0)]}).state.displacements
    for _ in range(8):
        tubes = tubes.update(load, place)
    moved = tubes.displacements(load, place)[:-1]
    assert moved == pytest.approx(wanted[:-1], abs=1e-8)


@pytest.mark.parametrize('away', [-1e-7, -1e-9, 1e-12, 1e-8, 1e-6])
def test_a_load_beside_a_guide_ring_acts_as_on_the_ring(away):
    ring = TRIANGLE.robot.description.module.guide_ring_distance
    for load in np.random.default_rng(0).normal(size=(8, 3)) * (20.0, 20.0, 0.5):
        beside, on = (
            deform(TRIANGLE, {}, tube_loads={LEG: [(place, *load)]}).state.displacements
            for place in (ring + away, ring)
        )
        # A millimetre along the tube changes displacements by 1.3 %.
        assert beside == pytest.approx(on, abs=(1e-6 + 15.0 * abs(away)) * np.abs(on).max())
