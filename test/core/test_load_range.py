# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Forces and moments out of range are refused, and those within it do not overflow."""

import warnings

from isotruss_ros.core import (
    analyze_grasp,
    ConvexObject,
    deform,
    ElasticObject,
    grasp_gradient,
    GraspRequirements,
    IsotrussError,
    load_robot,
    settle_grasp,
    tangent_center,
)
from isotruss_ros.core.numerics.arrays import MAX_LOAD
import numpy as np
import pytest

ROBOT = load_robot('nine_member')
HOME = ROBOT.home
BODY = ConvexObject.disc(tangent_center(HOME, 'north/Z', 0.3, 0.02), 0.3)
LOST = BODY.moved_to((0.0, 0.8, 0.0))
CALLS = {
    'analyze_grasp': lambda load: analyze_grasp(HOME, BODY, 0.5, load),
    'settle_grasp': lambda load: settle_grasp(HOME, BODY, 0.5, load),
    'settle_grasp of a lost object': lambda load: settle_grasp(HOME, LOST, 0.5, load),
    'grasp_gradient': lambda load: grasp_gradient(settle_grasp(HOME, BODY, 0.5, load)).slip_margin,
    'GraspRequirements': lambda load: GraspRequirements(external_wrench=tuple(load)),
    'elastic plant': lambda load: setattr(ElasticObject(BODY, 0.5), 'external_wrench', load),
    'joint': lambda load: deform(HOME, {'Z': load[:2]}, paper_model=True),
    'module': lambda load: deform(HOME, {}, module_loads={'north/Z': load}, paper_model=True),
    'tube': lambda load: deform(
        HOME, {}, tube_loads={'north/P-Z': [(0.5, *load)]}, paper_model=True
    ),
}


@pytest.mark.parametrize('name', CALLS)
@pytest.mark.parametrize('size', [1.01 * MAX_LOAD, 1e160, 1.7e308])
def test_loads_out_of_range_are_refused(name, size):
    for load in [(size, 0.0, 0.0), (0.0, -size, 0.0)]:
        with pytest.raises(IsotrussError, match=r': must be . finite numbers, at most'):
            CALLS[name](load)


@pytest.mark.parametrize('name', CALLS)
@pytest.mark.parametrize('load', MAX_LOAD * np.array([(1, 0, 0), (0, -1, 0), (1, 1, -1)]))
def test_the_largest_loads_do_not_overflow(name, load):
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        CALLS[name](load)


def test_the_largest_load_is_beyond_the_limit_load():
    with pytest.raises(IsotrussError, match='the loads are beyond the limit load'):
        deform(HOME, {'Z': (MAX_LOAD, MAX_LOAD)})
