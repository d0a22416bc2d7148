# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A held object that rubs on the floor: it stays up to a limit, and lags beyond."""

from grips import gripped
from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core import ElasticObject, Grip, solve_twist
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.simulation.floor_friction import limit_load
import numpy as np
import pytest
from scipy.optimize import minimize

CONFIG, CYLINDER = gripped(35.0, squeeze=0.1)
FRICTION, LIMIT = 0.5, 0.4
EVEN = np.array([1.0, 1.0, CYLINDER.arm])


def held(limit=LIMIT):
    """Return the object on a floor."""
    made = ElasticObject(CYLINDER, FRICTION, ground_friction=limit)
    made.follow(CONFIG)
    assert made.grasp is not None
    return made


def pose(made):
    """Return where the object is (3,), its turn over the arm [m]."""
    return EVEN * np.array(made.pose(CONFIG))


def pull(made, *sizes, direction=(0.6, -0.8, 0.0)):
    """Pull with one force after the other [N]."""
    for size in sizes:
        made.external_wrench = EVEN * size * np.array(direction)
        made.follow(CONFIG)


def drag(made, direction, length=0.02, steps=40):
    """Move the robot so that a free object would go along a direction; return its shape."""
    config = CONFIG
    for _ in range(steps):
        grip = Grip.at_module(config.robot, 'north/Z', CYLINDER.moved_to(made.pose(config)))
        twist = np.array(direction) * length / steps
        config = config.moved_to(
            config.roller_positions + solve_twist(config, grip, twist).roller_velocities
        )
        made.follow(config)
    return config


@pytest.mark.parametrize('direction', [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)])
def test_a_push_below_the_limit_moves_nothing(direction):
    made = held()
    before = pose(made)
    pull(made, 0.1, 0.39, direction=direction)
    assert pose(made) == pytest.approx(before, abs=1e-9)


def test_a_push_beyond_the_limit_is_met_by_the_limit_against_the_motion():
    rubbing, free = held(), held(limit=0.0)
    before = pose(rubbing)
    pull(rubbing, 0.7)
    moved, friction = pose(rubbing) - before, rubbing._floor.loads
    assert friction == pytest.approx(-LIMIT * moved / np.linalg.norm(moved), abs=1e-3)
    pull(free, 1.0, direction=0.7 * np.array([0.6, -0.8, 0.0]) + friction)
    assert pose(rubbing) == pytest.approx(pose(free), abs=1e-8)


def test_what_was_pushed_stays_where_it_was_pushed_to_until_twice_the_limit_is_gone():
    made = held()
    pull(made, 0.7)
    away = pose(made)
    pull(made, 0.4, 0.0, -0.05)
    assert pose(made) == pytest.approx(away, abs=1e-9)
    pull(made, -0.2)
    assert np.linalg.norm(pose(made) - away) > 1e-5


def test_the_lag_of_a_dragged_object_is_the_limit_over_the_stiffness():
    rubbing = held()
    start = pose(rubbing)
    config = drag(rubbing, (0.0, 1.0, 0.0))
    lag = rubbing.grasp
    compliance = EVEN[:, None] * lag.response.pose
    free = ElasticObject(CYLINDER, FRICTION)
    free.follow(CONFIG)
    free.follow(config)
    motion = pose(rubbing) - start
    friction = -LIMIT * motion / np.linalg.norm(motion)
    assert pose(rubbing) - pose(free) == pytest.approx(compliance @ friction, rel=0.1, abs=2e-5)


def test_the_rate_does_not_count():
    slow, quick = held(), held()
    drag(slow, (0.0, 1.0, 0.0), steps=100)
    drag(quick, (0.0, 1.0, 0.0), steps=20)
    assert pose(slow) == pytest.approx(pose(quick), abs=1e-4)


def test_a_floor_of_negative_friction_is_refused():
    with pytest.raises(GraspError, match=r'ground -1.0 under the object'):
        ElasticObject(CYLINDER, FRICTION, ground_friction=-1.0)


numbers = st.floats(-3.0, 3.0)


@given(st.tuples(numbers, numbers, numbers), st.integers(0, 999))
def test_the_limited_friction_is_the_nearest_in_energy(wanted, seed):
    root = np.random.default_rng(seed).normal(size=(3, 3))
    compliance, wanted = root @ root.T + 0.1 * np.eye(3), np.array(wanted)
    found = limit_load(wanted, compliance, 1.0)
    assert np.linalg.norm(found) <= 1.0 + 1e-9

    def energy(wrench):
        return (wrench - wanted) @ compliance @ (wrench - wanted)

    other = minimize(
        energy,
        wanted / max(1.0, np.linalg.norm(wanted)),
        constraints={'type': 'ineq', 'fun': lambda wrench: 1.0 - wrench @ wrench},
    )
    assert energy(found) <= energy(other.x) + 1e-6
