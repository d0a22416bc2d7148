# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Where the joints of a robot that holds an object are."""

from dataclasses import replace

from carries import Carry, GRASPS, make_robot, place
from isotruss_ros.core import deform
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.loaded_frame import held_joints
from mujoco_worlds import needs_mujoco
from nightly import some_now
import numpy as np
import pytest

ROBOT = make_robot()
NAMES = ROBOT.topology.joint_names
SOFT = 0.5


def held(name, robot=ROBOT, scale=1.0):
    """Return how the object of a grasp is held at home."""
    body, members = place(robot, name, 0.5)
    numbers = np.array([robot.member_names.index(each) for each in members])
    found = attach_grip(robot.home, body, numbers)
    return replace(found, tubes=found.tubes._replace(stiffness_scale=scale))


def give_at_feet(grip, loaded):
    """Return how far across and along, and how much turned, tubes are at contacts (textbook)."""
    piece, within = grip.statics.compliance.locate(grip.state.feet)
    frame = loaded.structure.frame
    start, end = frame.members.start[piece], frame.members.end[piece]
    axis = frame.axis[piece]
    length = np.abs(frame.points[end] - frame.points[start])
    ends = loaded.state.displacements
    u1, u2 = ((ends[n, 0] + 1j * ends[n, 1]) * axis.conj() for n in (start, end))
    turn1, turn2 = ends[start, 2], ends[end, 2]
    x = within / length
    phi = 12.0 * frame.members.flexural[piece] / (frame.members.shear[piece] * length**2)
    across = (
        (1 - 3 * x**2 + 2 * x**3 + phi * (1 - x)) * u1.imag
        + length * (x - 2 * x**2 + x**3 + phi / 2 * (x - x**2)) * turn1
        + (3 * x**2 - 2 * x**3 + phi * x) * u2.imag
        + length * (x**3 - x**2 + phi / 2 * (x**2 - x)) * turn2
    ) / (1 + phi)
    turned = (
        6.0 / length * (x**2 - x) * (u1.imag - u2.imag)
        + (1 - 4 * x + 3 * x**2 + phi * (1 - x)) * turn1
        + (3 * x**2 - 2 * x + phi * x) * turn2
    ) / (1 + phi)
    along = (1 - x) * u1.real + x * u2.real
    return across, along, turned, axis


#: With contacts between guide rings; outside of them an end of the piece has a hinge.
@pytest.mark.parametrize('name', sorted(set(GRASPS) - {'disc 0.1 m'}))
def test_contacts_move_a_joint_as_a_load_there_moves_the_contacts(name):
    """The theorem of Betti, with the displacements of `deform`."""
    grip = held(name, scale=SOFT)
    state, statics = grip.state, grip.statics
    moved = held_joints(grip) - ROBOT.home.nodes[: len(NAMES)]
    skin = statics.tube_radius - statics.indentation(state.normal_forces)[0]
    for joint, (x, y) in zip(NAMES, moved, strict=True):
        for direction, displacement in (((1.0, 0.0), x), ((0.0, 1.0), y)):
            loaded = deform(grip.config, {joint: direction})
            across, along, turned, axis = give_at_feet(grip, loaded)
            local = (
                (state.normal_forces + 1j * state.friction_forces) * state.normals * axis.conj()
            )
            work = local.imag * across + local.real * along - skin * state.friction_forces * turned
            expected = SOFT * displacement
            assert work.sum() == pytest.approx(expected, rel=1e-6, abs=1e-12)


@needs_mujoco
@pytest.mark.parametrize('name', some_now(reversed(GRASPS), 2))
def test_joints_are_where_mujoco_has_them_but_for_what_bending_shortens(name):
    """The statics is linear: a member bent by w is shorter by some w^2 over its length."""
    carry = Carry(name)
    carry.run(2.0)
    grip = carry.control.grasp
    at_rest = grip.config.nodes[: len(NAMES)]
    measured = carry.plant.nodes[: len(NAMES)] - at_rest
    assert held_joints(grip) - at_rest == pytest.approx(measured, abs=1.6e-3)


@needs_mujoco
def test_joints_between_tubes_far_apart_move_as_in_mujoco():
    carry = Carry('box')
    carry.run(2.0)
    grip = carry.control.grasp
    at_rest = grip.config.nodes[: len(NAMES)]
    measured = carry.plant.nodes[: len(NAMES)] - at_rest
    found = held_joints(grip) - at_rest
    assert np.abs(measured).max() > 7e-3
    assert np.linalg.norm(found - measured) < 0.15 * np.linalg.norm(measured)
