# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Loads that the tubes of a robot bear as it holds an object."""

import frames
from grips import gripped
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.contact_statics import TubeModel
from isotruss_ros.core.statics.structure import structure_of
import numpy as np
import pytest
import tubes


def disc(angle):
    """Return a disc pressed into the wedge of a module, in the paper's model."""
    return attach_grip(*gripped(angle, squeeze=0.1), tubes=TubeModel(paper_model=True))


@pytest.mark.parametrize('grasp', [disc(30.0), disc(45.0)])
def test_utilisation_agrees_with_a_frame_under_the_same_loads(grasp):
    structure, state, statics = structure_of(grasp.config), grasp.state, grasp.statics
    frame = tubes.robot_with_nodes(structure, grasp.contacts.members, state.feet)
    push = (state.normal_forces + 1j * state.friction_forces) * state.normals
    # From the bent centre lines to the skin, where friction acts.
    arms = -(statics.tube_radius - statics.indentation(state.normal_forces)[0]) * state.normals
    loads = np.zeros((len(frame.points), 3))
    loads[frame.nodes] = np.column_stack([push.real, push.imag, (arms.conj() * push).imag])
    rows, fixed = frames.dense(frame.rows, frame.points), frame.held
    *_, ends = frames.reference(frame.points, frame.members, fixed, loads, rows)
    expected = tubes.largest_utilisation(structure, frame, ends)
    assert grasp.sections.used == pytest.approx(expected, rel=1e-5, abs=1e-8)
    assert expected.max() > 0.1
