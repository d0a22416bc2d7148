# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How members give at moving places, against frames that are cut there."""

from grips import gripped
from isotruss_ros.core.statics.member_compliance import MemberCompliance
from isotruss_ros.core.statics.structure import structure_of
import numpy as np
import pytest
from tubes import robot_with_nodes

CONFIG, _ = gripped()
STRUCTURE = structure_of(CONFIG)
MODULE = CONFIG.robot.module_names.index('north/Z')
MEMBERS = (MODULE, int(CONFIG.robot.topology.previous[MODULE]))
GUIDE = CONFIG.robot.description.module.guide_ring_distance
STEP = 1e-6

of_all_kinds = pytest.mark.parametrize(
    'numbers', [MEMBERS, MEMBERS[:1] * 2, MEMBERS[1:] * 2, (*MEMBERS, MEMBERS[0])]
)


def random_places(members, rng):
    """Return places on all pieces of the members, often on the same of one member."""
    length, count = members.length, len(members.length)
    kinds = (
        rng.uniform(0.01, 0.9 * GUIDE, count),
        rng.uniform(1.1 * GUIDE, length - 1.1 * GUIDE),
        length - rng.uniform(0.01, 0.9 * GUIDE, count),
    )
    return np.choose(
        rng.integers(0, 3) if rng.random() < 0.5 else rng.integers(0, 3, count), kinds
    )


def cut_responses(members, numbers, at):
    """Return (k, 3, k, 3) displacements along and across, and slopes, of nodes at the places."""
    frame = robot_with_nodes(STRUCTURE, np.array(numbers), at)
    count = len(at)
    responses = np.zeros((count, 3, count, 3))
    for i, axis in enumerate(members.axis):
        for j, (x, y, moment) in enumerate(np.eye(3)):
            loads, force = np.zeros((len(frame.points), 3)), axis * (x + 1j * y)
            loads[frame.nodes[i]] = force.real, force.imag, moment
            state = frame.solve(loads)
            moved = state.displacements[frame.nodes]
            local = (moved[:, 0] + 1j * moved[:, 1]) * members.axis.conj()
            # The shear force before and behind the place leans the line against the sections.
            across = state.end_forces[frame.before, 4] - state.end_forces[frame.behind, 1]
            slope = moved[:, 2] + 0.5 * across / frame.members.shear[frame.before]
            responses[:, :, i, j] = np.stack([local.real, local.imag, slope], axis=1)
    return responses


@of_all_kinds
def test_loads_do_what_they_do_at_the_nodes_of_a_cut_frame(numbers):
    members, rng = MemberCompliance(STRUCTURE, numbers), np.random.default_rng(0)
    for _ in range(10):
        at = random_places(members, rng)
        expected = cut_responses(members, numbers, at)
        found = members.at(at)
        assert found.matrix == pytest.approx(expected, rel=1e-7, abs=1e-11)
        loads = rng.normal(size=(len(at), 3))
        given = np.einsum('irjc,jc->ir', expected, loads)
        assert found.respond(loads) == pytest.approx(given, rel=1e-7, abs=1e-11)


@of_all_kinds
def test_rates_are_the_derivatives_by_the_places(numbers):
    members, rng = MemberCompliance(STRUCTURE, numbers, 0.7), np.random.default_rng(2)
    for _ in range(20):
        at = random_places(members, rng)
        loads = rng.normal(size=(len(at), 3)) * [10.0, 10.0, 1.0]
        found = members.at(at).rates(loads)
        for j, move in enumerate(STEP * np.eye(len(at))):
            ahead, back = (members.at(at + sign * move).respond(loads) for sign in (1.0, -1.0))
            expected = (ahead - back) / (2.0 * STEP)
            assert found[:, :, j] == pytest.approx(expected, abs=1e-6 * np.abs(found).max())


def test_places_are_on_pieces_of_their_members():
    members, rng = MemberCompliance(STRUCTURE, MEMBERS), np.random.default_rng(6)
    frame = STRUCTURE.frame
    for _ in range(30):
        at = random_places(members, rng)
        pieces, within, ahead = STRUCTURE.locate(np.array(MEMBERS), at)
        points = frame.points[frame.members.start[pieces]] + within * frame.axis[pieces]
        assert points == pytest.approx(members.start + at * members.axis)
        assert frame.axis[pieces] == pytest.approx(ahead * members.axis)
        assert (within <= frame.length[pieces]).all()


@of_all_kinds
def test_a_softer_structure_gives_more_in_proportion(numbers):
    members = MemberCompliance(STRUCTURE, numbers)
    at = np.linspace(0.4, 0.6, len(numbers)) * members.length
    softer = MemberCompliance(STRUCTURE, numbers, scale=0.5).at(at)
    assert softer.matrix == pytest.approx(2.0 * members.at(at).matrix)
