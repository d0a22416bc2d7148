# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The tube's stiffness: each model against its own definition, its limits and its refusals."""

import re

from hypothesis import assume, given, strategies
from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.model.robot_file import read_robot_file
from isotruss_ros.core.model.stiffness_law import Law
from isotruss_ros.core.numerics.arrays import MAX_MAGNITUDE
from isotruss_ros.core.statics.beam_column import local_stiffness
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

PRESSURE = 34.5e3
RADIUS = 0.051
LENGTHS = np.array([0.254, 0.508, 0.762])
SECTION = {'axial_rigidity': 1.9e4, 'flexural_rigidity': 25.0, 'shear_rigidity': 1.9e3}


def end_stiffnesses(rigidities, lengths):
    """Return the axial, transverse and rotary stiffnesses that a load at one end meets."""
    matrices = local_stiffness(lengths, *rigidities)
    return matrices[:, 3, 3], matrices[:, 4, 4], matrices[:, 5, 5]


def model_of(block):
    """Return the model of a robot file with this stiffness block; none if None."""
    document = robots.example()
    document['tube']['stiffness'] = block
    if block is None:
        del document['tube']['stiffness']
    return tube_stiffness(read_robot_file(robots.write(document))).model


laws = strategies.builds(
    Law,
    strategies.floats(1e-3, 1e3),
    strategies.floats(-2.0, 2.0),
    strategies.floats(-4.0, 1.0),
)
lengths = strategies.floats(0.05, 5.0)
pressures = strategies.floats(1e3, 1e5)


def test_inflatable_beam_is_the_default_and_of_the_expected_order():
    model = model_of(None)
    assert model == model_of({'model': 'inflatable_beam'}) == InflatableBeam(RADIUS)
    rigidities = model.section_stiffness(LENGTHS, PRESSURE)
    assert rigidities.flexural == pytest.approx([25.4] * 3, rel=0.01)
    assert rigidities.shear == pytest.approx([1.88e3] * 3, rel=0.01)
    # The wall alone has 1.92e4 N; the ends take most of it from members of the paper's lengths.
    assert rigidities.axial == pytest.approx([1.51e3, 2.80e3, 3.91e3], rel=0.01)
    assert model.section_stiffness([1e6], PRESSURE).axial == pytest.approx([1.92e4], rel=0.01)


def test_inflatable_beam_against_the_formulas_with_a_thickness():
    t, E, G = 2e-4, 3e8, 0.5e8
    S0, I0 = 2.0 * np.pi * RADIUS * t, np.pi * RADIUS**3 * t
    P = PRESSURE * np.pi * RADIUS**2
    rigidities = InflatableBeam(RADIUS, E * t, G * t).section_stiffness(LENGTHS, PRESSURE)
    assert rigidities.flexural == pytest.approx([(E + P / S0) * I0] * 3, rel=1e-12)
    assert rigidities.shear == pytest.approx([P + 0.5 * G * S0] * 3, rel=1e-12)


def test_axial_stiffness_is_that_of_wall_and_ends_in_series():
    model = InflatableBeam(RADIUS, 5e4, 1e4, end_softening=3.0)
    axial, _, _ = end_stiffnesses(model.section_stiffness(LENGTHS, PRESSURE), LENGTHS)
    wall = 5e4 * 2.0 * np.pi * RADIUS / LENGTHS
    end = 3.0 * PRESSURE * RADIUS
    assert 1.0 / axial == pytest.approx(1.0 / wall + 2.0 / end, rel=1e-12)


def test_end_softening_is_the_slope_of_the_pillow():
    def lengthening(force):
        radius = RADIUS + force / (np.pi * RADIUS * PRESSURE)
        angle = np.arccos(1.0 - RADIUS / radius)
        return radius * (np.sin(angle) - angle)

    step = 1e-3
    slope = (lengthening(step) - lengthening(-step)) / (2.0 * step)
    assert InflatableBeam(RADIUS).end_softening == pytest.approx(
        1.0 / (slope * PRESSURE * RADIUS), rel=1e-6
    )


@robots.examples(200)
@given(laws, laws, strategies.floats(1e-6, 1e3), lengths, pressures, strategies.floats(0.0, 0.1))
def test_power_law_inverts_the_measured_end_stiffnesses(
    axial, transverse, phi, between, pressure, ring
):
    """Axially of the whole member, across and in rotation between its guide rings."""
    # The rotary law that a beam with this phi has, at this pressure and length.
    k = transverse.stiffness(np.array(between), np.array(pressure))
    rotary, whole = Law(float(k) * between**2 * (4.0 + phi) / 12.0, 0.0, 0.0), between + 2.0 * ring
    assume(1.0 / MAX_MAGNITUDE <= rotary.C <= MAX_MAGNITUDE)
    rigidities = PowerLaw(axial, transverse, rotary, ring).section_stiffness([whole], pressure)
    for mode, law in enumerate((axial, transverse, rotary)):
        length = between if mode else whole
        measured = end_stiffnesses(rigidities, np.array([length]))[mode]
        expected = law.C * pressure**law.a * length**law.b
        assert measured == pytest.approx([expected], rel=1e-9)
    assert 12.0 * rigidities.flexural / (rigidities.shear * between**2) == pytest.approx(
        [phi], rel=1e-6
    )


@pytest.mark.parametrize('rounding', [-1e-12, 0.0, 1e-12])
def test_power_law_of_a_slender_beam_has_infinite_shear_rigidity(rounding):
    EI = 25.0 * (1.0 + rounding)
    model = PowerLaw(Law(1.0, 0.0, -1.0), Law(300.0, 0.0, -3.0), Law(4.0 * EI, 0.0, -1.0), 0.0)
    rigidities = model.section_stiffness(LENGTHS, PRESSURE)
    assert rigidities.shear.tolist() == [np.inf] * 3
    assert rigidities.flexural == pytest.approx([25.0] * 3, rel=1e-9)
    _, transverse, rotary = end_stiffnesses(rigidities, LENGTHS)
    assert transverse == pytest.approx(300.0 / LENGTHS**3, rel=1e-9)
    assert rotary == pytest.approx(100.0 / LENGTHS, rel=1e-9)


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
    short = PowerLaw(Law(1e3, 0.0, 0.0), Law(1e3, 0.0, 0.0), Law(0.99 * needed, 0.0, 0.0), 0.0)
    with pytest.raises(StructureError, match='no beam has'):
        short.section_stiffness([0.508], PRESSURE)


@pytest.mark.parametrize('exponent', [1e12, -1e12, 40.0])
def test_law_that_leaves_the_range_of_numbers_is_refused(exponent):
    bent = Law(1.0, exponent, 0.0)
    model = PowerLaw(Law(1e3, 0.0, 0.0), bent, Law(1e3, 0.0, 0.0), 0.0)
    with pytest.raises(StructureError, match=r'law transverse: .* 0\.254 m at 34500 Pa: must be'):
        model.section_stiffness(LENGTHS, PRESSURE)


MODELS = [
    InflatableBeam(RADIUS),
    Section(**SECTION, radius=0.051, pressure=34500.0),
    PowerLaw(Law(8.0, 0.6, 0.0), Law(0.5, 0.6, -1.0), Law(0.3, 0.6, 0.5), 0.08),
]


def test_section_at_another_pressure_changes_by_the_pull_of_the_pressure():
    model = model_of({'model': 'section', **SECTION, 'pressure': 20e3})
    pull = 10e3 * np.pi * RADIUS**2
    EA, EI, GA = model.section_stiffness([0.5], 30e3)
    assert (EA[0], EI[0], GA[0]) == pytest.approx(
        (1.9e4, 25.0 + pull * RADIUS**2 / 2, 1.9e3 + pull)
    )


def test_section_without_stiffness_at_low_pressure_is_refused():
    model = Section(1.9e4, 25.0, 200.0, RADIUS, 34.5e3)
    with pytest.raises(StructureError, match=r'given at 34500 Pa: at 5000 Pa it has .* GA = -41'):
        model.section_stiffness([0.5], 5e3)


def test_member_shorter_than_its_guide_rings_is_refused():
    with pytest.raises(StructureError, match=r'a member of 0\.15 m does not hold its guide rings'):
        MODELS[2].section_stiffness([0.15], PRESSURE)


@pytest.mark.parametrize('model', MODELS, ids=lambda model: type(model).__name__)
@pytest.mark.parametrize('value', [0.0, -1.0, np.nan, np.inf])
def test_length_and_pressure_must_be_positive_numbers(model, value):
    with pytest.raises(StructureError, match=r'length of a tube member: .* m: must be a positive'):
        model.section_stiffness([0.5, value], PRESSURE)
    with pytest.raises(StructureError, match=r'gauge pressure .* Pa: must be a positive'):
        model.section_stiffness([0.5], value)


def test_blocks_of_a_robot_file_have_all_that_a_model_needs():
    softer = {'membrane_modulus': 40000, 'membrane_shear_modulus': 5e3, 'end_softening': 2}
    model = model_of({'model': 'inflatable_beam', **softer})
    assert model == InflatableBeam(RADIUS, 4e4, 5e3, 2.0)
    assert isinstance(model.membrane_modulus, float)
    block = {
        'model': 'power_law',
        'axial': {'C': 8, 'a': 0.6, 'b': 0},
        'transverse': {'C': 0.5, 'a': 0.6, 'b': -1.0},
        'rotary': {'C': 0.3, 'a': 0.6, 'b': 0.5},
    }
    assert model_of(block) == MODELS[2]


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
        """Return differences of the second order, with the error of half their step taken off."""
        found = []
        for share in (1.0, 0.5):
            ends = [
                1.0
                / np.array(
                    model.section_stiffness(
                        LENGTHS + sign * share * by_length, pressure + sign * share * by_pressure
                    )
                )
                for sign in (1.0, -1.0)
            ]
            found.append((ends[0] - ends[1]) / (2.0 * share * (by_length + by_pressure)))
        return (4.0 * found[1] - found[0]) / 3.0

    rates = TubeSections(model).flexibility_rates(LENGTHS, pressure)
    for found, expected in zip(rates, (difference(1e-3, 0.0), difference(0.0, 30.0)), strict=True):
        assert found == pytest.approx(expected, rel=1e-7, abs=1e-14)
    assert (np.abs(rates[1]).max(axis=1) > 0.0).any()
