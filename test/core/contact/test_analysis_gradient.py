# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Gradients of grasps of objects held fast against central differences of analyses."""

from itertools import islice

from isotruss_ros.core import analyze_grasp
from isotruss_ros.core.contact import sliding_contact
from isotruss_ros.core.contact.analysis_gradient import analysis_gradient
from isotruss_ros.core.errors import GraspError, SolverError
import numpy as np
import pytest
from random_grasps import largest_error, RandomGrasp, SHARES

SIZES = {'rollers': 4e-6, 'place': 4e-6, 'pressures': 10.0, 'friction': 1e-3, 'wrench': 1e-2}


@pytest.fixture(autouse=True)
def settle_well(monkeypatch):
    """Close gaps well: the directions of the forces settle to the root of that."""
    monkeypatch.setattr(sliding_contact, 'GAP_TOLERANCE', 1e-15)


def analyse(case, chosen):
    """Return the analysis of a random grasp with other parameters."""
    given = chosen.config, chosen.body, chosen.friction, chosen.wrench
    return analyze_grasp(*given, flattening=case.flattening, pressure=chosen.pressures)


def values(analysis):
    """Return what a gradient is of, by the names of its fields; moments over the arm."""
    arm = analysis.solution.body.arm
    return {
        'normal_forces': analysis.normal_forces,
        'normal_wrench': analysis.normal_wrench / (1.0, 1.0, arm),
        'closure_margin': np.array([analysis.closure_margin]),
    }


def error(number):
    """Return the largest error of the gradient of a random grasp; None where contacts change."""
    case = RandomGrasp(number)
    try:
        analysis = analyse(case, case.chosen)
        gradient = analysis_gradient(analysis)
        parameters = gradient.parameters
        step = case.step(parameters, SIZES)
        moved = [analyse(case, case.chosen.changed(s * step, parameters)) for s in SHARES]
    except SolverError:
        return None
    touching = (analysis.normal_forces > 0.0).tolist()
    if any((each.normal_forces > 0.0).tolist() != touching for each in moved):
        return None
    reached = [values(each) for each in moved]
    exact = {name: np.atleast_2d(getattr(gradient, name)) for name in reached[0]}
    exact['normal_wrench'] = exact['normal_wrench'] / [[1.0], [1.0], [case.chosen.body.arm]]
    return largest_error(exact, reached, step)


@pytest.mark.parametrize('wanted', [20, pytest.param(200, marks=pytest.mark.nightly)])
def test_gradients_are_those_of_central_differences(wanted):
    found = (error(number) for number in range(5 * wanted))
    compared = [*islice((each for each in found if each is not None), wanted)]
    assert len(compared) == wanted
    assert max(compared) < 1e-6


@pytest.mark.parametrize('number', range(8))
def test_forces_grow_with_the_stiffness_of_the_robot(number):
    case = RandomGrasp(number)
    analysis = analyse(case, case.chosen)
    gradient = analysis_gradient(analysis)
    by_stiffness = gradient.normal_forces[:, gradient.parameters.stiffness]
    assert by_stiffness == pytest.approx(analysis.normal_forces, rel=1e-6)


@pytest.mark.parametrize('number', range(8))
def test_the_opening_wrench_takes_off_of_the_margin_what_it_is(number):
    case = RandomGrasp(number)
    gradient = analysis_gradient(analyse(case, case.chosen))
    wrench = gradient.opening * (1.0, 1.0, case.chosen.body.arm)
    by_wrench = gradient.closure_margin[gradient.parameters.wrench]
    assert by_wrench @ wrench == pytest.approx(-1.0)


def test_an_object_that_nothing_touches_has_no_gradient():
    case = RandomGrasp(0)
    away = case.chosen._replace(body=case.chosen.body.moved_to((5.0, 5.0, 0.0)))
    with pytest.raises(GraspError, match='0 points of contact'):
        analysis_gradient(analyse(case, away))
