# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Forces and moments out of range are refused, and those within it do not overflow."""

import warnings

from isotruss_ros.core import (
    analyze_grasp,
    ConvexObject,
    deform,
    grasp_gradient,
    GraspRequirements,
    IsotrussError,
    load_robot,
    settle_grasp,
    tangent_center,
)
from isotruss_ros.core.inputs import RejectedInput, StampedInput
from isotruss_ros.core.numerics.arrays import MAX_LOAD
from isotruss_ros.core.servo.servo_state import check_input
from isotruss_ros.core.simulation.elastic_object import ElasticObject
import numpy as np
import pytest

ROBOT = load_robot('nine_member')
HOME = ROBOT.home
BODY = ConvexObject.disc(tangent_center(HOME, 'north/Z', 0.3, 0.02), 0.3)
HUGE = (1.01 * MAX_LOAD, 1e160, 1.7e308)


def differentiate(wrench):
    """Settle a grasp under a wrench, and read all derivatives of it."""
    settled = settle_grasp(HOME, BODY, 0.5, wrench)
    found = grasp_gradient(settled)
    return found.stiffness, found.slip_margin


def take(wrench):
    """Give a wrench to a servo."""
    found = check_input(ROBOT, 'wrench', StampedInput(wrench, 0.0))
    if isinstance(found, RejectedInput):
        raise IsotrussError(found.reason)


WRENCHES = {
    'analyze_grasp': lambda wrench: analyze_grasp(HOME, BODY, 0.5, wrench),
    'settle_grasp': lambda wrench: settle_grasp(HOME, BODY, 0.5, wrench),
    'settle_grasp of a lost object': lambda wrench: settle_grasp(
        HOME, BODY.moved_to((0.0, 0.8, 0.0)), 0.5, wrench
    ),
    'grasp_gradient': differentiate,
    'GraspRequirements': lambda wrench: GraspRequirements(external_wrench=tuple(wrench)),
    'servo': take,
    'elastic plant': lambda wrench: setattr(ElasticObject(BODY, 0.5), 'external_wrench', wrench),
}
LOADS = {
    'joint': lambda load, linear: deform(HOME, {'Z': load[:2]}, paper_model=linear),
    'module': lambda load, linear: deform(
        HOME, {}, module_loads={'north/Z': load}, paper_model=linear
    ),
    'tube': lambda load, linear: deform(
        HOME, {}, tube_loads={ROBOT.member_names[0]: [(0.5, *load)]}, paper_model=linear
    ),
}


@pytest.fixture(autouse=True)
def _no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        yield


@pytest.mark.parametrize('call', WRENCHES.values(), ids=WRENCHES)
@pytest.mark.parametrize('size', HUGE)
def test_wrenches_out_of_range_are_refused(call, size):
    for wrench in size * np.eye(3), -size * np.ones((1, 3)):
        for load in wrench.tolist():
            with pytest.raises(
                IsotrussError, match=r'wrench.*: must be 3 finite numbers, at most'
            ):
                call(load)


@pytest.mark.parametrize('call', WRENCHES.values(), ids=WRENCHES)
@pytest.mark.parametrize('wrench', MAX_LOAD * np.array([(1, 0, 0), (0, -1, 0), (1, 1, -1)]))
def test_the_largest_wrenches_do_not_overflow(call, wrench):
    call(wrench)


@pytest.mark.parametrize('call', LOADS.values(), ids=LOADS)
@pytest.mark.parametrize('linear', [True, False])
@pytest.mark.parametrize('size', HUGE)
def test_loads_out_of_range_are_refused(call, linear, size):
    for load in (size, 0.0, 0.0), (0.0, -size, 0.0):
        with pytest.raises(
            IsotrussError, match=r'the load \(.*: must be . finite numbers, at most'
        ):
            call(load, linear)


@pytest.mark.parametrize('call', LOADS.values(), ids=LOADS)
def test_the_largest_loads_do_not_overflow(call):
    assert np.isfinite(call((MAX_LOAD, MAX_LOAD, 0.0), True).state.displacements).all()
    with pytest.raises(IsotrussError, match='the loads are beyond the limit load'):
        call((MAX_LOAD, MAX_LOAD, 0.0), False)
