# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Section loads under forces, against frames in which the loads are on nodes."""

from hypothesis import given
from isotruss_ros.core.statics.bent_tubes import straight_tubes
from isotruss_ros.core.statics.structure import structure_of
from isotruss_ros.core.statics.wrinkling import load_sections
import numpy as np
import pytest
import robots
import tubes


def whole_end_forces(structure, frame, ends):
    """Return the end forces (k, 6) of the members of a frame by those of their parts."""
    whole = structure.frame
    found = np.zeros((len(whole.members.start), 6))
    starts, stops = frame.points[frame.members.start], frame.points[frame.members.end]
    for number in range(len(found)):
        parts = np.flatnonzero(frame.whole == number)
        begin = whole.points[whole.members.start[number]]
        end = whole.points[whole.members.end[number]]
        found[number, :3] = ends[parts[np.abs(starts[parts] - begin).argmin()], :3]
        found[number, 3:] = ends[parts[np.abs(stops[parts] - end).argmin()], 3:]
    return found


@robots.examples(20)
@given(robots.robots(), robots.generators())
def test_section_loads_are_those_of_a_frame_with_loads_on_nodes(robot, rng):
    config = robots.random_state(robot, rng)
    structure = structure_of(config)
    # Two loads on each of two members, the second behind the first on the same piece.
    member = np.repeat(rng.permutation(len(robot.member_names))[:2], 2)
    place = np.sort(rng.uniform(0.3, 0.7, (2, 2)), axis=1).ravel() * config.member_lengths[member]
    force = 20.0 * (rng.normal(size=4) + 1j * rng.normal(size=4))
    topology = robot.topology
    start, end = topology.b[member], topology.c[topology.following[member]]
    axis = config.points[end] - config.points[start]
    local = force / (axis / np.abs(axis))

    frame = tubes.robot_with_nodes(structure, member, place)
    loads = np.zeros((len(frame.points), 3))
    np.add.at(loads, frame.nodes, np.column_stack([force.real, force.imag, 0.0 * force.real]))
    ends = frame.solve(loads).end_forces
    before, behind = ends[frame.before], ends[frame.behind]
    *_, ahead = structure.locate(member, place)
    given_ends = whole_end_forces(structure, frame, ends)
    found = load_sections(straight_tubes(structure), given_ends, member, place, local)

    assert found.moment == pytest.approx(ahead * before[:, 5], rel=1e-5, abs=1e-7)
    larger = np.maximum(before[:, 0], behind[:, 0])
    assert found.compression == pytest.approx(larger, rel=1e-5, abs=1e-5)
    expected = tubes.largest_utilisation(structure, frame, ends)
    assert found.utilisation == pytest.approx(expected, rel=1e-5, abs=1e-7)
