# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""How members give at moving places, against the contact points of the analysis."""

from grips import gripped
from isotruss_ros.core.contact.contact_points import find_contact_points
from isotruss_ros.core.statics.member_compliance import MemberCompliance
from isotruss_ros.core.statics.structure import structure_of
import numpy as np
import pytest
from shapes import circle

CONFIG, CYLINDER = gripped()
STRUCTURE = structure_of(CONFIG)
MODULE = CONFIG.robot.module_names.index('north/Z')
MEMBERS = (MODULE, int(CONFIG.robot.topology.previous[MODULE]))
GUIDE = CONFIG.robot.description.module.guide_ring_distance
STEP = 1e-6
FIRST = np.array([1.0, 0.0])


@pytest.fixture(scope='module')
def members():
    """Return the compliance of the two members at the tip of the robot."""
    return MemberCompliance(STRUCTURE, MEMBERS)


def places(members, rng):
    """Return places on all pieces of the members, and on their guide rings nearly."""
    length = members.length
    kinds = (
        rng.uniform(0.01, 0.9 * GUIDE, 2),
        rng.uniform(1.1 * GUIDE, length - 1.1 * GUIDE),
        length - rng.uniform(0.01, 0.9 * GUIDE, 2),
    )
    return np.choose(rng.integers(0, 3, 2), kinds)


def test_places_are_on_pieces_of_their_members(members):
    rng, frame = np.random.default_rng(6), STRUCTURE.frame
    for _ in range(30):
        at = places(members, rng)
        pieces, within = members.locate(at)
        points = frame.points[frame.members.start[pieces]] + within * frame.axis[pieces]
        assert points == pytest.approx(members.start + at * members.axis)
        assert (within <= frame.length[pieces]).all()


def test_displacements_are_those_of_the_contact_points(members):
    center = CYLINDER.center
    points = find_contact_points(STRUCTURE, circle(center, 0.5), 0.02)
    rng = np.random.default_rng(0)
    for _ in range(30):
        pair = [int(rng.choice(np.flatnonzero(points.member == i))) for i in MEMBERS]
        forces = np.zeros(len(points.points), dtype=complex)
        forces[pair] = rng.normal(size=2) + 1j * rng.normal(size=2)
        at = ((points.points[pair] - members.start) * members.axis.conj()).real
        local = forces[pair] * members.axis.conj()
        loads = np.column_stack([local.real, local.imag, np.zeros(2)])
        found = members.at(at).respond(loads)
        moved = members.axis * (found[:, 0] + 1j * found[:, 1])
        assert moved == pytest.approx(points.displacements(forces)[pair], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize('numbers', [MEMBERS, MEMBERS[:1] * 2])
def test_a_moment_does_elsewhere_what_the_rotation_of_the_section_does_here(numbers):
    """Betti: by a force elsewhere the section turns by theta = w' + EI w''' / GA."""
    members = MemberCompliance(STRUCTURE, numbers)
    first = -len(CONFIG.robot.member_names) + MEMBERS[0]
    frame = STRUCTURE.frame.members
    ratio = frame.flexural[first] / frame.shear[first]
    rng = np.random.default_rng(1)
    for _ in range(20):
        at = rng.uniform(1.5 * GUIDE, members.length - 1.5 * GUIDE)
        if numbers[0] == numbers[1] and np.ptp(at) < 0.03:
            continue  # the force is between the places of the difference
        matrices = [members.at(at + sign * STEP * FIRST).matrix for sign in (1.0, -1.0)]
        slope = (matrices[0] - matrices[1])[0, 1, 1, :2] / (2.0 * STEP)
        assert members.at(at).matrix[0, 2, 1, :2] == pytest.approx(slope, rel=1e-6, abs=1e-10)
        slopes = [members.at(at + 0.01 * k * FIRST).matrix[0, 2, 1, :2] for k in (-1, 0, 1)]
        section = slopes[1] + ratio * (slopes[2] - 2.0 * slopes[1] + slopes[0]) / 1e-4
        assert members.at(at).matrix[1, :2, 0, 2] == pytest.approx(section, rel=1e-6, abs=1e-10)


def test_rates_are_the_derivatives_by_the_places(members):
    rng = np.random.default_rng(2)
    for _ in range(30):
        at, loads = places(members, rng), rng.normal(size=(2, 3)) * [10.0, 10.0, 1.0]
        found = members.at(at).rates(loads)
        for j, move in enumerate(STEP * np.eye(2)):
            ahead, back = (members.at(at + sign * move).respond(loads) for sign in (1.0, -1.0))
            expected = (ahead - back) / (2.0 * STEP)
            assert found[:, :, j] == pytest.approx(expected, abs=1e-7 * np.abs(found).max())


@pytest.mark.parametrize('numbers', [MEMBERS, MEMBERS[:1] * 2])
def test_a_softer_structure_gives_more_in_proportion(numbers):
    members = MemberCompliance(STRUCTURE, numbers)
    at = np.array([0.4, 0.6]) * members.length
    loads = np.array([[1.0, 2.0, 0.3], [-1.0, 0.5, 0.1]])
    softer = MemberCompliance(STRUCTURE, numbers, scale=0.5).at(at)
    assert softer.respond(loads) == pytest.approx(2.0 * members.at(at).respond(loads))
    assert softer.rates(loads) == pytest.approx(2.0 * members.at(at).rates(loads))


@pytest.mark.parametrize('pinned_piece', [False, True])
def test_two_places_on_one_member_are_those_of_the_contact_points(pinned_piece):
    center = CYLINDER.center
    points = find_contact_points(STRUCTURE, circle(center, 0.9), 0.01)
    rng = np.random.default_rng(1)
    for number in MEMBERS:
        members = MemberCompliance(STRUCTURE, [number, number])
        own = np.flatnonzero(points.member == number)
        if pinned_piece:
            own = own[points.place[own] < GUIDE]
        for _ in range(10 if len(own) > 1 else 0):
            pair = rng.choice(own, 2, replace=False)
            forces = np.zeros(len(points.points), dtype=complex)
            forces[pair] = rng.normal(size=2) + 1j * rng.normal(size=2)
            at = ((points.points[pair] - members.start) * members.axis.conj()).real
            local = forces[pair] * members.axis.conj()
            found = members.at(at).respond(np.column_stack([local.real, local.imag, np.zeros(2)]))
            moved = members.axis * (found[:, 0] + 1j * found[:, 1])
            assert moved == pytest.approx(points.displacements(forces)[pair], rel=1e-9, abs=1e-12)


def test_two_places_on_one_member_have_the_rates_of_differences_and_reciprocity():
    rng = np.random.default_rng(2)
    compared = 0
    for number in MEMBERS:
        members = MemberCompliance(STRUCTURE, [number, number], 0.7)
        length = float(members.length[0])
        for low, high in ((0.01, 0.9 * GUIDE), (0.2, 0.8), (length - 0.9 * GUIDE, length - 0.01)):
            at = rng.uniform(low, high, 2)
            loads = rng.normal(size=(2, 3))
            contact = members.at(at)
            rates = contact.rates(loads)
            for k in range(2):
                step = STEP * np.eye(2)[k]
                change = members.at(at + step).respond(loads) - members.at(at - step).respond(
                    loads
                )
                assert rates[:, :, k] == pytest.approx(change / (2.0 * STEP), rel=1e-4, abs=1e-9)
            across = contact.matrix[:, :2, :, :2].reshape(4, 4)
            assert across == pytest.approx(across.T, rel=1e-8, abs=1e-12)
            compared += 1
    assert compared == 6
