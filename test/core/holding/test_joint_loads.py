# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Loads on a held object and on the joints of the robot that holds it, and what tubes bear."""

from boxes import box_between, SIDES
import frames
from grips import gripped
from held_grips import numbers
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.contact_statics import TubeModel
from isotruss_ros.core.holding.joint_loads import joint_compliance, LoadedParts
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.statics.structure import structure_of
import numpy as np
import pytest
import tubes

CONFIG, CYLINDER = gripped(35.0, squeeze=0.1)
PLACED = box_between(depth=0.02).body
GRIPS = [attach_grip(CONFIG, CYLINDER), attach_grip(CONFIG.robot.home, PLACED, numbers(SIDES))]


def test_joints_give_as_the_linear_frame_does_under_forces_on_its_nodes():
    grip = attach_grip(CONFIG, CYLINDER, tubes=TubeModel(paper_model=True))
    frame, found = grip.statics.bent.frame, joint_compliance(grip)[0]
    for i in range(len(found)):
        loads = np.zeros((len(frame.points), 3))
        loads[i // 2, i % 2] = 1.0
        moved = frame.solve(loads).displacements[: len(found) // 2, :2].ravel()
        assert found[:, i] == pytest.approx(moved, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize('grip', GRIPS)
@pytest.mark.parametrize('loaded', ['object', 'joints'])
def test_object_and_joints_move_by_their_compliance(grip, loaded):
    parts = LoadedParts.find(grip, True)
    loads = 1e-3 * np.random.default_rng(0).normal(size=len(parts.places))
    loads[slice(3, None) if loaded == 'object' else slice(3)] = 0.0
    ahead, behind = (
        LoadedParts.find(
            roll_grip(parts.load(grip, way), grip.config, way[:3] * (1.0, 1.0, grip.arm)),
            True,
            way,
        )
        for way in (loads, -loads)
    )
    expected = 2.0 * parts.compliance @ loads
    # Follower forces: what the object does to a joint is nearly what that does to the object.
    moved = ahead.places - behind.places
    assert moved == pytest.approx(expected, abs=0.01 * np.abs(expected).max())
    alone = LoadedParts.find(grip, False)
    assert alone.places == pytest.approx(parts.places[:3])
    assert alone.compliance == pytest.approx(parts.compliance[:3, :3], abs=1e-5)


def disc(angle):
    """Return a disc pressed into the wedge of a module, in the paper's model."""
    return attach_grip(*gripped(angle, squeeze=0.1), tubes=TubeModel(paper_model=True))


@pytest.mark.parametrize('grasp', [disc(30.0), disc(45.0)])
def test_tubes_bear_what_a_frame_under_the_same_loads_does(grasp):
    structure, state, statics = structure_of(grasp.config), grasp.state, grasp.statics
    frame = tubes.robot_with_nodes(structure, grasp.contacts.members, state.feet)
    push = (state.normal_forces + 1j * state.friction_forces) * state.normals
    # From the bent centre lines to the skin, where friction acts.
    arms = -(statics.tube_radius - statics.indentation(state.normal_forces)[0]) * state.normals
    loads = np.zeros((len(frame.points), 3))
    loads[frame.nodes] = np.column_stack([push.real, push.imag, (arms.conj() * push).imag])
    rows, fixed = frames.dense(frame.rows, frame.points), frame._held.reshape(-1, 3)
    *_, ends = frames.reference(frame.points, frame.members, fixed, loads, rows)
    expected = tubes.largest_utilisation(structure, frame, ends)
    assert grasp.sections.used == pytest.approx(expected, rel=1e-5, abs=1e-8)
    assert expected.max() > 0.1
