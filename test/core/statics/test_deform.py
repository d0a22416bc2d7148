# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Deformed robots: limit load, utilisation, sag, and stiffness of tubes by each model."""

import re

from hypothesis import assume, given
from hypothesis import strategies as st
from isotruss_ros.core import deform, load_robot
from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.model.robot_file import read_robot_file
from isotruss_ros.core.model.stiffness_law import Law
from isotruss_ros.core.numerics.arrays import MAX_MAGNITUDE
from isotruss_ros.core.statics.deform import find_sag
from isotruss_ros.core.statics.frame import local_stiffness
from isotruss_ros.core.statics.structure import structure_of
from isotruss_ros.core.statics.tangent import follow_loads
from isotruss_ros.core.statics.tube_stiffness import (
    InflatableBeam,
    PowerLaw,
    Section,
    tube_stiffness,
    TubeSections,
)
import numpy as np
import pytest
import robots

TRIANGLE = load_robot('triangle').home
LEG = 'main/R-T'
RING = TRIANGLE.robot.description.module.guide_ring_distance
LENGTH = float(TRIANGLE.member_lengths[TRIANGLE.robot.member_names.index(LEG)])


def test_beyond_the_limit_load_the_error_names_it():
    assert deform(TRIANGLE, {'T': (0.0, 0.1)}).limit_factor() == np.inf
    limit = deform(TRIANGLE, {'T': (0.0, -100.0)}).limit_factor()
    assert deform(TRIANGLE, {'T': (0.0, -99.0 * limit)}).displacement('T')[1] < 0.0
    with pytest.raises(StructureError, match=r'unstable at 0\.9[78]\d* times these loads'):
        deform(TRIANGLE, {'T': (0.0, -102.0 * limit)})


# Newton's method alone finds a stable state beyond a limit load at the first three.
@pytest.mark.parametrize('seed', [39, 204, 315, 0, 1])
def test_a_state_beyond_a_limit_load_that_small_steps_do_not_reach_is_refused(seed):
    rng, robot = np.random.default_rng(seed), robots.random_robot(seed)
    config = robots.extreme_state(robot, rng)
    joint = str(rng.choice(list(robot.description.joints)))
    force = rng.uniform(-1.0, 1.0, 2) * 10.0 ** rng.uniform(0.0, 2.0)
    structure = structure_of(config)
    loads = np.zeros((len(structure.node_names), 3))
    loads[structure.node(joint), :2] = force
    straight, _ = structure.unloaded
    path = follow_loads(straight, loads, 1.0)
    if path.factors[-1] < 1.0:
        with pytest.raises(StructureError, match='beyond the limit load'):
            deform(config, {joint: force})
    else:
        bent = deform(config, {joint: force}).state.displacements
        assert bent == pytest.approx(path.tangents[-1].displacements, abs=1e-7)


@pytest.mark.parametrize('on_tube', [False, True])
def test_a_force_acts_at_its_place_on_a_tube_or_in_the_middle_of_a_module(on_tube):
    load, nodes = (
        (0.3, -1.0, 0.5),
        dict(zip(TRIANGLE.robot.node_names, TRIANGLE.points, strict=True)),
    )
    place = 0.3 * LENGTH
    loads = (
        {'tube_loads': {LEG: [(place, *load)]}} if on_tube else {'module_loads': {'main/T': load}}
    )
    bent = deform(TRIANGLE, {}, **loads, paper_model=True)
    middle = 0.5 * (nodes['main/T/B'] + nodes['main/T/C'])
    if on_tube:
        start, end = robots.member_ends(TRIANGLE, LEG)
        middle = start + 0.3 * (end - start)
    # The supports bear the force and its moment about the origin.
    forces = {joint: complex(*reaction) for joint, reaction in bent.reactions.items()}
    assert sum(forces.values()) == pytest.approx(-complex(*load[:2]), abs=1e-9)
    moment = sum((nodes[joint].conjugate() * force).imag for joint, force in forces.items())
    about_origin = load[2] + (middle.conjugate() * complex(*load[:2])).imag
    assert moment == pytest.approx(-about_origin, abs=1e-9)


@pytest.mark.parametrize('paper_model', [False, True])
def test_utilisation_is_the_largest_moment_over_the_wrinkling_moment_of_the_wall(paper_model):
    places = [(place, 0.0, 0.0, 0.0) for place in np.linspace(0.02, 0.98, 49) * LENGTH]
    load = {'T': (0.0, -150.0)}
    used = deform(TRIANGLE, load, paper_model=paper_model).utilisation[LEG]
    cut = deform(TRIANGLE, load, tube_loads={LEG: places}, paper_model=paper_model)
    member = TRIANGLE.robot.member_names.index(LEG)
    ends = cut.state.end_forces[cut.frame.layout.whole == cut.structure.pieces[2][member]]
    radius = 0.5 * TRIANGLE.robot.description.tube_diameter
    wall = np.pi * radius**2 * cut.structure.pressures[0] - ends[:, 0].max()
    assert used == pytest.approx(np.abs(ends[:, 2]).max() / (0.5 * radius * wall), rel=5e-3)


@pytest.mark.parametrize(
    ('loads', 'complaint'),
    [
        ({'joint_loads': {'W': (0.0, -1.0)}}, "joint 'W': robot triangle .*L, R, T"),
        ({'joint_loads': {'T': (np.nan, 0.0)}}, 'joint T.*must be 2 finite numbers'),
        ({'joint_loads': {'T': (1.7e308, 0.0)}}, r'joint T: .*at most 1e\+06'),
        ({'module_loads': {'main/W': (0.0, 0.0, 1.0)}}, "module 'main/W'.*main/L, main/R, main/T"),
        ({'tube_loads': {'main/W': [(0.1, 0.0, 0.0, 1.0)]}}, "member 'main/W'.*main/R-T"),
        ({'tube_loads': {LEG: [(LENGTH, 0.0, 0.0, 1.0)]}}, 'of member .*must be between'),
        ({'pressure': {'west': 2e4}}, "tube 'west': robot triangle .*its tubes are main"),
        ({'pressure': [2e4, 2e4]}, '2 values: must be one for all tubes, or one for each of main'),
        ({'pressure': [0.0]}, 'gauge pressure of tube main .*: 0.0: must be from 1000 to 300000'),
        ({'pressure': np.nan}, 'gauge pressure of tube main .*must be a finite number'),
    ],
)
def test_invalid_loads_and_pressures_are_refused(loads, complaint):
    with pytest.raises(StructureError, match=complaint):
        deform(TRIANGLE, **{'joint_loads': {}, **loads})


@pytest.mark.parametrize('ring', [RING, LENGTH - RING])
@pytest.mark.parametrize('away', [-1e-7, -1e-9, 1e-12, 1e-8, 1e-6])
def test_a_load_beside_a_guide_ring_acts_as_on_the_ring(ring, away):
    for load in np.random.default_rng(0).normal(size=(8, 3)) * (20.0, 20.0, 0.5):
        beside, on = (
            deform(TRIANGLE, {}, tube_loads={LEG: [(place, *load)]}).state.displacements
            for place in (ring + away, ring)
        )
        # A millimetre along the tube changes displacements by 1.3 %.
        assert beside == pytest.approx(on, abs=(1e-6 + 15.0 * abs(away)) * np.abs(on).max())


ROBOT = load_robot('nine_member')
NAMES = ROBOT.topology.joint_names


def hanging(weight, config=ROBOT.home, noise=1e-3, seed=0):
    """Return measured joints of a robot whose modules have some weight (x, y) [N]."""
    rng = np.random.default_rng(seed)
    bent = deform(config, {}, module_loads=dict.fromkeys(ROBOT.module_names, (*weight, 0.0)))
    places = config.nodes[: len(NAMES)] + noise * rng.normal(size=(len(NAMES), 2))
    return {
        name: tuple(place + bent.displacement(name)[:2])
        for name, place in zip(NAMES, places, strict=True)
    }


@pytest.mark.parametrize('direction', [(0.0, -1.0), (1.0, 0.0)])
@pytest.mark.parametrize('mass', [0.5, 1.5])
def test_weight_and_direction_of_an_upright_robot_are_estimated(direction, mass):
    weight = 9.81 * mass * np.array(direction)
    config = ROBOT.home.moved_to(0.1 * np.array([1.0, -0.5, 0.3, 0.8, -1.0, 0.2]))
    sag = find_sag(config, hanging(weight, config))
    assert sag.is_upright
    assert np.hypot(*(sag.weight - weight)) < 0.25 * np.hypot(*weight)


def test_roller_offsets_and_noise_are_rarely_fitted_as_weight():
    sag, rng = [], np.random.default_rng(0)
    for seed in range(50):
        config = ROBOT.home.moved_to(0.01 * rng.normal(size=6))
        sag.append(find_sag(ROBOT.home, hanging((0.0, 0.0), config, seed=seed)).is_upright)
    assert sum(sag) <= 3


def test_few_joints_have_no_fit():
    joints = dict(list(hanging((0.0, -9.81)).items())[:3])
    assert find_sag(ROBOT.home, joints) is None


PRESSURE = 34.5e3
RADIUS = 0.051
LENGTHS = np.array([0.254, 0.508, 0.762])
SECTION = {'axial_rigidity': 1.9e4, 'flexural_rigidity': 25.0, 'shear_rigidity': 1.9e3}


def model_of(block):
    """Return the model of a robot file with this stiffness block; none if None."""
    document = robots.example()
    document['tube']['stiffness'] = block
    if block is None:
        del document['tube']['stiffness']
    return tube_stiffness(read_robot_file(robots.write(document))).model


laws = st.builds(Law, st.floats(1e-3, 1e3), st.floats(-2.0, 2.0), st.floats(-4.0, 1.0))
lengths = st.floats(0.05, 5.0)
pressures = st.floats(1e3, 1e5)


def test_inflatable_beam_is_the_default_and_of_the_expected_order():
    model = model_of(None)
    assert model == model_of({'model': 'inflatable_beam'}) == InflatableBeam(RADIUS)
    rigidities = model.section_stiffness(LENGTHS, PRESSURE)
    assert rigidities.flexural == pytest.approx([25.4] * 3, rel=0.01)
    assert rigidities.shear == pytest.approx([1.88e3] * 3, rel=0.01)
    # The wall alone has 1.92e4 N; the ends take most of it from members of the paper's lengths.
    assert rigidities.axial == pytest.approx([1.51e3, 2.80e3, 3.91e3], rel=0.01)
    assert model.section_stiffness([1e6], PRESSURE).axial == pytest.approx([1.92e4], rel=0.01)


def test_end_softening_is_the_slope_of_the_pillow():
    def lengthening(force):
        radius = RADIUS + force / (np.pi * RADIUS * PRESSURE)
        angle = np.arccos(1.0 - RADIUS / radius)
        return radius * (np.sin(angle) - angle)

    step = 1e-3
    slope = (lengthening(step) - lengthening(-step)) / (2.0 * step)
    expected = 1.0 / (slope * PRESSURE * RADIUS)
    assert InflatableBeam(RADIUS).end_softening == pytest.approx(expected, rel=1e-6)


@robots.examples(200)
@given(laws, laws, st.floats(1e-6, 1e3), lengths, pressures, st.floats(0.0, 0.1))
def test_power_law_inverts_end_stiffnesses(axial, transverse, phi, between, pressure, ring):
    """Axially of the whole member, across and in rotation between its guide rings."""
    # The rotary law that a beam with this phi has, at this pressure and length.
    k = transverse.stiffness(np.array(between), np.array(pressure))
    rotary, whole = Law(float(k) * between**2 * (4.0 + phi) / 12.0, 0.0, 0.0), between + 2.0 * ring
    assume(1.0 / MAX_MAGNITUDE <= rotary.C <= MAX_MAGNITUDE)
    rigidities = PowerLaw(axial, transverse, rotary, ring).section_stiffness([whole], pressure)
    for mode, law in enumerate((axial, transverse, rotary)):
        length = between if mode else whole
        # Axially, across and in rotation at a loaded end.
        measured = local_stiffness(np.array([length]), *rigidities)[:, 3 + mode, 3 + mode]
        expected = law.C * pressure**law.a * length**law.b
        assert measured == pytest.approx([expected], rel=1e-9)
    ratio = 12.0 * rigidities.flexural / (rigidities.shear * between**2)
    assert ratio == pytest.approx([phi], rel=1e-6)


def test_power_law_without_a_beam_is_refused_with_the_valid_range():
    # Right at 0.254 m (phi > 0) and wrong from where L^2 passes 3 k_rotary / k_transverse.
    model = PowerLaw(Law(1e3, 0.0, 0.0), Law(1e3, 0.0, 0.0), Law(50.0, 0.0, 0.0), 0.0)
    model.section_stiffness([0.254], PRESSURE)
    with pytest.raises(StructureError) as caught:
        model.section_stiffness(LENGTHS, PRESSURE)
    message = str(caught.value)
    for part in ('0.508 m', '34500 Pa', '1000 N/m', '50 N m/rad', 'at least l^2/3'):
        assert part in message, message
    needed = float(re.findall(r'([\d.]+) N m/rad', message)[-1])
    mended = PowerLaw(Law(1e3, 0.0, 0.0), Law(1e3, 0.0, 0.0), Law(1.001 * needed, 0.0, 0.0), 0.0)
    mended.section_stiffness([0.508], PRESSURE)


MODELS = [
    InflatableBeam(RADIUS),
    Section(**SECTION, radius=0.051, pressure=34500.0),
    PowerLaw(Law(8.0, 0.6, 0.0), Law(0.5, 0.6, -1.0), Law(0.3, 0.6, 0.5), 0.08),
]


def test_section_at_another_pressure_changes_by_the_pull_of_the_pressure():
    model = model_of({'model': 'section', **SECTION, 'pressure': 20e3})
    pull = 10e3 * np.pi * RADIUS**2
    EA, EI, GA = model.section_stiffness([0.5], 30e3)
    expected = (1.9e4, 25.0 + pull * RADIUS**2 / 2, 1.9e3 + pull)
    assert (EA[0], EI[0], GA[0]) == pytest.approx(expected)


def test_member_shorter_than_its_guide_rings_is_refused():
    with pytest.raises(StructureError, match=r'a member of 0\.15 m does not hold its guide rings'):
        MODELS[2].section_stiffness([0.15], PRESSURE)


@pytest.mark.parametrize('model', MODELS, ids=lambda model: type(model).__name__)
@pytest.mark.parametrize('value', [0.0, np.nan, np.inf])
def test_length_and_pressure_must_be_positive_numbers(model, value):
    with pytest.raises(StructureError, match=r'length of a tube member: .* m: must be a positive'):
        model.section_stiffness([0.5, value], PRESSURE)
    with pytest.raises(StructureError, match=r'gauge pressure .* Pa: must be a positive'):
        model.section_stiffness([0.5], value)


@pytest.mark.parametrize(
    'model',
    [
        InflatableBeam(RADIUS, 5e4, 1e4, end_softening=3.0),
        Section(4e3, 25.0, 1.9e3, RADIUS, 30e3),
        PowerLaw(Law(8.0, 0.6, -0.2), Law(0.5, 0.6, -1.2), Law(0.3, 0.6, 0.9), 0.08),
        # Without shear: the rotary law is L^2/3 times the transverse one.
        PowerLaw(Law(8.0, 0.6, -0.2), Law(0.3, 0.6, -1.2), Law(0.1, 0.6, 0.8), 0.08),
    ],
)
def test_flexibility_rates_agree_with_finite_differences(model):
    pressure = np.array([25e3, 30e3, 40e3])

    def difference(by_length, by_pressure):
        ahead, behind = (
            1.0 / np.array(model.section_stiffness(LENGTHS + length, pressure + change))
            for length, change in ((by_length, by_pressure), (-by_length, -by_pressure))
        )
        return (ahead - behind) / (2.0 * (by_length + by_pressure))

    rates = TubeSections(model).flexibility_rates(LENGTHS, pressure)
    for actual, expected in zip(rates, (difference(1e-5, 0.0), difference(0.0, 1.0)), strict=True):
        assert actual == pytest.approx(expected, rel=1e-6, abs=1e-13)
    assert (np.abs(rates[1]).max(axis=1) > 0.0).any()
