# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Frames of one robot in many shapes: the numbers of each `Structure` on its own."""

from isotruss_ros.core import load_robot
from isotruss_ros.core.statics.beam_stack import beam_stack
from isotruss_ros.core.statics.frame_stack import FrameStack
from isotruss_ros.core.statics.structure import Structure, tube_pieces
import numpy as np
import pytest
import robots

CASES = (*robots.PRESETS, 0, 1, 2, 'uneven')
COUNT = 4


def make(case):
    """Return a preset, a random robot, or one with tubes of three and of four members."""
    if case != 'uneven':
        return load_robot(case) if isinstance(case, str) else robots.random_robot(case)
    document = robots.example()
    document['joints'] = {'P': [0.0, 0.0], 'Q': [2.0, 0.0], 'X': [1.0, 1.8]}
    document['joints'] |= {'Y': [2.3, 1.35], 'Z': [1.0, 0.6]}
    kite = {'joints': ['Q', 'Y', 'X', 'Z'], 'passive': 'Y'}
    document['tubes'] = {'kite': kite} | document['tubes']
    return robots.load(document)


@pytest.fixture(params=CASES, scope='module')
def shapes(request):
    """Return structures of a robot in several shapes, and the same ones as a stack."""
    robot = make(request.param)
    rng = np.random.default_rng(5)
    structures = [Structure(robots.random_state(robot, rng)) for _ in range(COUNT)]
    points = np.stack([structure.config.points for structure in structures], axis=1)
    return structures, FrameStack(robot, points, structures[0].pressures)


def some_pieces(structures, rng):
    """Return shapes, members of the frames and their slots: two in each shape but the first."""
    pieces = tube_pieces(structures[0].config.robot.topology.n_modules)[-1]
    first = rng.choice(pieces, COUNT)
    second = pieces[(np.searchsorted(pieces, first) + 1) % len(pieces)]
    shape = np.concatenate([np.arange(COUNT), np.arange(1, COUNT)])
    slot = np.repeat([0, 1], [COUNT, COUNT - 1])
    return shape, np.concatenate([first, second[1:]]), slot


def assert_near(found, expected, rtol=1e-8):
    """Compare arrays against the largest number of the expected one."""
    np.testing.assert_allclose(found, expected, atol=rtol * np.abs(expected).max(), rtol=0.0)


def test_points_lengths_and_sections_are_those_of_the_structures(shapes):
    structures, stack = shapes
    for i, structure in enumerate(structures):
        members = structure.frame.members
        np.testing.assert_array_equal(stack.points[:, i], structure.frame.points)
        np.testing.assert_array_equal(stack.lengths[:, i], structure.config.member_lengths)
        for found, own in zip(
            stack.sections[:, :, i], (members.axial, members.flexural, members.shear), strict=True
        ):
            np.testing.assert_array_equal(found, own)


def test_ends_of_loaded_members_give_as_in_the_structures(shapes):
    structures, stack = shapes
    shape, piece, slot = some_pieces(structures, np.random.default_rng(1))
    loaded = stack.load(shape, piece, slot)
    assert loaded.ends.shape == (COUNT, 12, 12)
    assert not loaded.suspicious.any()
    for i, structure in enumerate(structures):
        own = piece[shape == i]
        turn = structure.frame.to_member_frame(own)
        compliance = structure.frame.compliance(own).reshape(len(own), 6, len(own), 6)
        expected = np.einsum('asr,asbt,btu->arbu', turn, compliance, turn)
        size = 6 * len(own)
        assert_near(loaded.ends[i, :size, :size], expected.reshape(size, size))


def test_pieces_of_tube_bear_what_they_do_in_the_structures(shapes):
    structures, stack = shapes
    rng = np.random.default_rng(2)
    shape, piece, slot = some_pieces(structures, rng)
    loads = rng.standard_normal((COUNT, 12))
    loads[0, 6:] = 0.0
    forces = stack.load(shape, piece, slot).tube_forces(loads)
    for i, structure in enumerate(structures):
        frame = structure.frame
        on_nodes = np.zeros((len(frame.points), 3))
        for number, at in zip(piece[shape == i], slot[shape == i], strict=True):
            own = loads[i].reshape(2, 6)[at]
            on_nodes[frame.members.start[number]] += own[:3]
            on_nodes[frame.members.end[number]] += own[3:]
        pieces = tube_pieces(len(structure.config.robot.module_names)).ravel()
        assert_near(forces[:, :, i].T, frame.solve(on_nodes).end_forces[pieces])


def test_a_shape_that_is_a_mechanism_is_suspicious():
    robot = load_robot('triangle')
    points = np.stack([robot.home.points] * 2, axis=1)
    pressures = tuple(robot.description.pressures.values())
    stack = FrameStack(robot, points, pressures)
    soft = FrameStack(robot, points, pressures)
    # Modules and tubes of the second one are as good as nothing, against its scale.
    weak = np.array([1.0, 1e-12])
    beams = soft.beams
    soft.beams = beams._replace(
        **{
            name: getattr(beams, name) * weak
            for name in beams._fields
            if name not in ('direction', 'length')
        }
    )
    which = np.arange(2), np.full(2, tube_pieces(3)[-1, 0]), np.zeros(2, dtype=np.intp)
    assert stack.load(*which).suspicious.tolist() == [False, False]
    assert soft.load(*which).suspicious.tolist() == [False, True]


@pytest.mark.parametrize('pinned', [False, True])
def test_a_cantilever_bends_as_in_the_book(pinned):
    # EI = 2, GA = 3, EA = 5, L = 2, along y: fixed at its start, or with a pin there.
    sections = np.array([5.0, 2.0, 3.0])[:, None, None]
    beams = beam_stack(np.array([[2.0j]]), sections, np.array([[pinned]]))
    numbers = {name: getattr(beams, name).item() for name in beams._fields}
    assert numbers['direction'] == 1j
    assert numbers['length'] == 2.0
    assert numbers['axial'] == pytest.approx(5.0 / 2.0)
    # A force at the tip, which turns freely: L^3 / (3 EI) + L / GA.
    tip = 2.0**3 / (3.0 * 2.0) + 2.0 / 3.0
    if pinned:
        # The end's own stiffness with a pin at the start: by reciprocity that of the tip.
        assert numbers['transverse'] == pytest.approx(1.0 / tip)
        assert numbers['to_end'] == pytest.approx(2.0 / tip)
        assert numbers['end'] == pytest.approx(4.0 / tip)
        assert numbers['to_start'] == numbers['start'] == numbers['far'] == 0.0
        return
    turning = np.array(
        [[numbers['transverse'], -numbers['to_end']], [-numbers['to_end'], numbers['end']]]
    )
    compliance = np.linalg.inv(turning)
    assert compliance[0, 0] == pytest.approx(tip)
    assert compliance[0, 1] == pytest.approx(2.0**2 / (2.0 * 2.0))
    assert compliance[1, 1] == pytest.approx(2.0 / 2.0)
    assert numbers['start'] == numbers['end']
    assert numbers['to_start'] == numbers['to_end']
    # Moments about the start balance: M_start + M_end = V L.
    assert numbers['start'] + numbers['far'] == pytest.approx(2.0 * numbers['to_start'])


@pytest.mark.parametrize('angle', [0.0, 0.7, np.pi / 2, -2.5])
def test_entries_are_those_of_the_turned_matrix(angle):
    sections = np.array([5.0, 2.0, 3.0])[:, None, None]
    beams = beam_stack(2.0 * np.exp([[1j * angle]]), sections, np.array([[False]]))
    xx, xy, yy, *_ = beams.entries()[:, 0, 0]
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    along = np.diag([beams.axial.item(), beams.transverse.item()])
    np.testing.assert_allclose([[xx, xy], [xy, yy]], turn.T @ along @ turn, atol=1e-12)
