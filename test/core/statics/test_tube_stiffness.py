# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The tube's stiffness: each model against its own definition, its limits and its refusals."""

import re

from hypothesis import assume, given
from hypothesis import strategies as st
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
