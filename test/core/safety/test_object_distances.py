# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Distances of an object in a grip of any members: rows against differences, and what counts."""

from hypothesis import assume, given
from isotruss_ros.core import ConvexObject, load_robot, Polygon, RollingGrip
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.safety.barrier_law import BarrierLaw
from isotruss_ros.core.safety.barriers import ObjectBarrier
from isotruss_ros.core.safety.margins import object_distances
import numpy as np
import pytest
from random_grips import random_convex_grip
import robots

EVERY = BarrierLaw(0.0, 10.0)


@robots.examples(50)
@given(robots.robots(), robots.generators())
def test_distances_within_the_band_are_those_of_the_surface(robot, rng):
    """Those of the circle around the object, which is farther out, are for what is far off."""
    config, grip = random_convex_grip(robot, rng, 'module')
    assume(grip is not None)
    band = rng.uniform(0.05, 0.5)
    barrier = ObjectBarrier(robot, BarrierLaw(0.0, band))
    distances = object_distances(config, grip.body, grip.members)
    near = barrier.active(config, grip)
    assert near.indices.tolist() == np.flatnonzero(distances < band).tolist()
    assert near.values == pytest.approx(distances[near.indices], abs=1e-12)


@robots.examples(10)
@given(robots.robots(), robots.generators())
def test_rows_are_derivatives_of_the_distances(robot, rng):
    config, grip = random_convex_grip(robot, rng, 'module')
    assume(grip is not None)
    # A polygon touches with its faces and corners, where its distances have kinks.
    assume(not isinstance(grip.body.shape, Polygon))
    barrier = ObjectBarrier(robot, EVERY)
    near = barrier.active(config, grip)
    assume(len(near.indices))
    rows = config.roller_rows(near.node_rows) + near.roller_rows
    rolling = RollingGrip.attach(config, grip)
    way = rng.standard_normal(len(robot.roller_names))
    # Where the contacts are not kept the motion is that of least squares; the rows are not.
    way -= np.linalg.pinv(_misfits(config, grip)) @ _misfits(config, grip) @ way
    step, values = 1e-6, []
    for sign in (1.0, -1.0):
        there = config.moved_to(config.roller_positions + sign * step * way)
        values.append(barrier.values(there, rolling.moved_to(there).grip, near.indices))
    found = (values[0] - values[1]) / (2.0 * step)
    # A corner of a part may be as near as its side: there the slope has two values.
    smooth = np.abs(values[0] + values[1] - 2.0 * near.values) < 1e-10
    assert (rows @ way)[smooth] == pytest.approx(found[smooth], abs=1e-5)


def _misfits(config, grip):
    """Return the rows by which contacts are not kept."""
    return grip_jacobian(config, grip)[3:]


def test_sides_that_do_not_meet_leave_out_themselves_only():
    robot = load_robot('nine_member')
    members = ('south/P-Q', 'north/R-P')
    body = ConvexObject.disc((0.5, -0.2), 0.5)
    distances = object_distances(robot.home, body, members, 10.0).reshape(3, -1)
    left_out = [robot.member_names[i] for i in np.flatnonzero(np.isinf(distances[0]))]
    assert sorted(left_out) == sorted(members)
    assert np.isfinite(distances[1:]).all()
