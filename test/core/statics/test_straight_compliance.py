# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compliance of straight tubes at points, against frames with nodes at these points."""

from hypothesis import given
from isotruss_ros.core.statics.straight_compliance import straight_compliance
from isotruss_ros.core.statics.structure import structure_of
import numpy as np
import robots
from robots import examples, generators
import tubes


@examples(20)
@given(robots.robots(), generators())
def test_compliance_agrees_with_that_of_nodes_at_the_points(robot, rng):
    structure = structure_of(robots.random_state(robot, rng))
    lengths = structure.config.member_lengths
    members = np.sort(rng.integers(len(lengths), size=7))
    # Some of them are between pinch points and guide rings.
    places = lengths[members] * rng.choice([0.02, 0.97, 0.4, 0.6], 7)
    places += 1e-3 * np.arange(7)
    frame = tubes.robot_with_nodes(structure, members, places)
    expected = tubes.node_compliance(frame, frame.nodes)
    found = straight_compliance(structure, members, places)
    assert np.abs(found - expected).max() < 1e-7 * np.abs(expected).max()
