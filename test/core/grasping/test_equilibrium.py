# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The equations of a held object: derivatives, balance, touch, rolling."""

from dataclasses import replace

from grips import gripped
from isotruss_ros.core.grasping.balance import ANGLE, CENTER
from isotruss_ros.core.grasping.depths import member_depths
from isotruss_ros.core.grasping.equilibrium import (
    FEET,
    find_anchors,
    FRICTION,
    INCLINATIONS,
    keep_place,
    no_indentation,
    NORMAL,
    roll,
    SIZE,
)
from isotruss_ros.core.grasping.held_members import (
    held_object_statics,
    static_start,
)
import numpy as np
import pytest

CONFIG, CYLINDER = gripped(squeeze=0.05)
CENTER_POINT = CYLINDER.center
NOTHING = np.zeros(3)


@pytest.fixture(scope='module')
def statics():
    """Return the equations of an object between the two members at the tip."""
    return held_object_statics(CONFIG, CYLINDER, members(), flattening=False)


def members():
    """Return the numbers of the grasping members."""
    return np.sort(np.argsort(member_depths(CONFIG, CYLINDER))[-2:])


def start(statics):
    """Return unknowns to begin with."""
    return static_start(statics, CENTER_POINT, member_depths(CONFIG, CYLINDER)[members()])


def dents(forces):
    """Return a made-up indentation of the skin, and its derivative."""
    return 1e-4 * forces + 1e-6 * forces**2, 1e-4 + 2e-6 * forces


def closures(statics):
    """Return both closures, away from where they hold."""
    yield keep_place(CENTER_POINT + 0.01 + 0.02j, 0.1)
    yield roll(np.array([0.1, 0.2]), np.array([0.3, 0.1]), statics)


def test_jacobian_is_the_derivative_of_the_residual(statics):
    rng = np.random.default_rng(0)
    scale = np.array([0.01, 0.01, 0.1, 0.01, 0.01, 0.05, 0.05, 3.0, 3.0, 3.0, 3.0])
    dented = type(statics)(
        statics.compliance, statics.radius, statics.tube_radius, statics.sides, dents
    )
    for system in (statics, dented):
        for closure in closures(system):
            unknowns = start(system) + rng.normal(size=SIZE) * scale
            _, jacobian, _ = system.equations(unknowns, NOTHING, closure)
            for i, move in enumerate(1e-6 * np.eye(SIZE)):
                ahead, back = (
                    system.equations(unknowns + sign * move, NOTHING, closure)[0]
                    for sign in (1.0, -1.0)
                )
                assert jacobian[:, i] == pytest.approx((ahead - back) / 2e-6, abs=1e-7)


@pytest.mark.parametrize('indentation', [no_indentation, dents])
def test_the_equilibrium_balances_and_touches(statics, indentation):
    statics = replace(statics, indentation=indentation)
    wrench = np.array([1.0, -2.0, 0.5])
    state = statics.solve(start(statics), wrench, keep_place(CENTER_POINT, 0.2))
    forces = (state.normal_forces + 1j * state.friction_forces) * state.normals
    left = -forces.sum() + complex(wrench[0], wrench[1])
    assert abs(left) < 1e-9 * state.normal_forces.sum()
    assert state.friction_forces.sum() == pytest.approx(wrench[2])
    assert state.unknowns[ANGLE] == pytest.approx(0.2)
    # The bent centre lines touch a disc of both radii less the dents, tangentially. Friction acts
    # at the dented skin, with that arm about the centre line.
    arms = statics.tube_radius - indentation(state.normal_forces)[0]
    unknowns = state.unknowns
    local = forces * statics.compliance.axis.conj()
    moments = -arms * state.friction_forces
    loads = np.column_stack([local.real, local.imag, moments])
    given = statics.compliance.at(unknowns[FEET]).respond(loads)
    points = statics.compliance.start + statics.compliance.axis * (
        unknowns[FEET] + given[:, 0] + 1j * given[:, 1]
    )
    away = points - state.center
    assert np.abs(away) == pytest.approx(statics.radius + arms, abs=1e-10)
    along = statics.compliance.axis * (1.0 + 1j * given[:, 2])
    assert (away.conj() * along).real == pytest.approx(0.0, abs=1e-10)


def test_without_a_past_the_place_along_the_bisector_is_the_given_one(statics):
    state = statics.solve(start(statics), NOTHING, keep_place(CENTER_POINT, 0.0))
    along = 1j * (state.normals[0] - state.normals[1])
    assert abs(state.center - CENTER_POINT) > 1e-3
    assert ((state.center - CENTER_POINT) * along.conjugate()).real == pytest.approx(0.0, abs=1e-9)


def test_rolling_from_where_it_is_stays_there_and_follows_the_tube(statics):
    state = statics.solve(start(statics), NOTHING, keep_place(CENTER_POINT, 0.3))
    travel = np.array([0.01, -0.02])
    anchors = find_anchors(state.unknowns, travel, statics)
    same = statics.solve(start(statics), NOTHING, roll(anchors, travel, statics))
    assert same.unknowns == pytest.approx(state.unknowns, abs=1e-9)
    # Up to whole turns of the object.
    turns = 2.0 * np.pi * statics.radius * np.array([7.0, -50.0])
    again = statics.solve(start(statics), NOTHING, roll(anchors + turns, travel, statics))
    assert again.unknowns == pytest.approx(state.unknowns, abs=1e-9)
    # Both tubes run past the object alike: it turns in place (17), as far as 2 travel / d.
    sense = -statics.sides
    along = 0.02
    turned = statics.solve(state.unknowns, NOTHING, roll(anchors, travel + along * sense, statics))
    assert turned.unknowns[ANGLE] == pytest.approx(0.3 + along / statics.radius, abs=1e-9)
    for part in (CENTER, FEET, INCLINATIONS, NORMAL, FRICTION):
        assert turned.unknowns[part] == pytest.approx(state.unknowns[part], abs=1e-8)


def test_what_has_no_solution_gives_none(statics):
    away = np.array([0.0, 1e4, 0.0])
    assert statics.solve(start(statics), away, keep_place(CENTER_POINT, 0.0)) is None
