# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Comparison of measured runs with the model: the parameter that deviates is named."""

from dataclasses import replace
import functools

from elastic_runs import FRICTION, run_elastic
from isotruss_ros.identification.hypotheses import compare_run, find_prior
from isotruss_ros.identification.report import block, describe
from isotruss_ros.identification.rolled_run import Parameters
import pytest

WRONG = {
    'friction': {'friction': 0.68},
    'tube': {'stiffness': 0.7},
    'offsets': {'offset': 0.006},
    'pressure': {'pressure': 0.8},
    'delay': {'delay': 1},
    'creep': {'creep': 0.35},
    'none': {},
}
#: Number of intervals of runs that need few [-].
FEW = 10


@functools.cache
def compare(name):
    """Return the comparison of the run with one deviation."""
    return compare_run(run_elastic(**WRONG[name]))


@pytest.mark.parametrize('name', WRONG)
def test_the_deviating_parameter_is_named(name):
    assert compare(name).named == name, '\n'.join(describe(compare(name)))


@pytest.mark.parametrize(('name', 'true'), [('tube', -0.3), ('friction', 0.68 - FRICTION)])
def test_estimate_is_within_three_deviations_of_the_truth(name, true):
    fit, part = compare(name).hypotheses[name], getattr(Parameters.of(compare(name).run), name)
    assert fit.estimate[part][0] == pytest.approx(true, abs=3.0 * fit.deviation[part][0])


def test_a_wrong_mass_is_not_taken_for_another_parameter():
    assert compare_run(run_elastic(mass=1.6)).named in ('none', 'mass')


def test_pressure_without_recorded_pressures_is_not_determined():
    run = run_elastic(pressures_recorded=False, count=FEW)
    assert not compare_run(run).hypotheses['pressure'].is_determined


def test_prior_of_a_measured_interval_of_friction_is_its_deviation():
    run = run_elastic(count=FEW)
    body = replace(run.grip.body, uncertainty={'friction': [0.7, 0.9]})
    prior = find_prior(replace(run, grip=replace(run.grip, body=body)))
    assert prior[Parameters.of(run).friction] == pytest.approx(0.2 / 12.0**0.5)


def test_mass_without_gravity_is_not_determined():
    compared = compare_run(run_elastic(is_inclined=False, count=FEW))
    assert not compared.hypotheses['mass'].is_determined
    assert 'mass of the object: not determined by this run' in '\n'.join(describe(compared))


def test_block_has_the_stiffness_for_the_robot_file():
    lines = block(compare('tube')).splitlines()
    line = next(line for line in lines if 'stiffness_scale' in line)
    assert float(line.split(':')[-1].strip(' }')) == pytest.approx(0.7, abs=0.1)
