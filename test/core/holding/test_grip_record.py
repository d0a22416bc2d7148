# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A held grip that another process restores from numbers."""

from held_grips import APART, BOX, held, HOME
from isotruss_ros.core import Disc
from isotruss_ros.core.errors import GraspError, StructureError
from isotruss_ros.core.holding.contact_statics import ContactStatics
from isotruss_ros.core.holding.grip_record import GripRecord
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.roll_grip import roll_grip, with_pressures
from isotruss_ros.core.statics.bent_tubes import BentTubes
import numpy as np
import pytest


def rolled(shape, angle):
    """Return a grip that has rolled, so that its friction is not that of unknown history."""
    grip = held(shape, angle, APART)
    for step in np.full(4, 0.004):
        travel = grip.config.roller_positions + step * np.array([0.3, -0.5, 0.2, 0.4, 0.1, -0.2])
        grip = roll_grip(grip, grip.config.moved_to(travel))
        assert isinstance(grip, HeldGrip)
    return grip


@pytest.mark.parametrize(('shape', 'angle'), [(Disc(0.3), 0.4), (BOX, 0.2), (BOX, 0.0)])
def test_restored_grip_has_pose_forces_and_margins_of_the_original(shape, angle):
    grip = rolled(shape, angle)
    found = GripRecord.of(grip).restore(HOME, grip.body)
    assert found.pose == pytest.approx(grip.pose, abs=1e-12)
    assert found.state.forces == pytest.approx(grip.state.forces, abs=1e-9)
    assert found.sections.used == pytest.approx(grip.sections.used, abs=1e-5)
    assert found.slip_margin(0.5) == pytest.approx(grip.slip_margin(0.5), rel=1e-3)


def test_restored_grip_is_evaluated_and_not_solved_for(monkeypatch):
    grip = rolled(BOX, 0.2)
    record = GripRecord.of(grip)
    for kind, name in ((ContactStatics, 'settle'), (BentTubes, 'update')):
        monkeypatch.setattr(kind, name, lambda *_: pytest.fail('a grip was solved for'))
    assert record.restore(HOME, grip.body).squeeze == pytest.approx(grip.squeeze, rel=1e-9)


def test_restored_grip_rolls_as_the_original():
    grip = rolled(BOX, 0.2)
    there = grip.config.moved_to(grip.config.roller_positions + 0.003)
    expected = roll_grip(grip, there)
    found = roll_grip(GripRecord.of(grip).restore(HOME, grip.body), there)
    assert found.pose == pytest.approx(expected.pose, abs=1e-5)
    assert found.squeeze == pytest.approx(expected.squeeze, rel=1e-3)


def test_bent_tubes_of_another_structure_are_refused():
    grip = held(BOX, 0.2, APART)
    record = GripRecord.of(grip)
    with pytest.raises(StructureError, match='must be 203'):
        record._replace(bent=record.bent[1:]).restore(HOME, grip.body)


def test_record_has_pressures_if_they_differ_from_the_robot_file():
    grip = held(BOX, 0.2, APART)
    assert GripRecord.of(grip).pressures is None
    pressures = tuple(30e3 + 1e3 * np.arange(3))
    assert GripRecord.of(with_pressures(grip, pressures)).pressures == pytest.approx(pressures)


def test_restored_grip_of_an_object_without_such_corners_is_refused():
    grip = held(BOX, 0.2, APART)
    record = GripRecord.of(grip)
    contacts = record.contacts
    contacts.corners[:] = 7
    with pytest.raises(GraspError, match='no such corners'):
        record.restore(grip.config, grip.body)
