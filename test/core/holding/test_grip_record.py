# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A held grip that another process restores from numbers."""

from held_grips import APART, BOX, held, HOME
from isotruss_ros.core import Disc
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.grip_record import GripRecord
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.roll_grip import roll_grip, with_pressures
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
def test_restored_grip_has_pose_and_forces_of_the_original(shape, angle):
    grip = rolled(shape, angle)
    found = GripRecord.of(grip).restore(HOME.moved_to(grip.config.roller_positions), grip.body)
    assert found.pose == pytest.approx(grip.pose, abs=1e-5)
    assert found.state.forces == pytest.approx(grip.state.forces, rel=1e-3, abs=1e-3)
    assert found.slip_margin(0.5) == pytest.approx(grip.slip_margin(0.5), rel=1e-3)


def test_restored_grip_rolls_as_the_original():
    grip = rolled(BOX, 0.2)
    there = grip.config.moved_to(grip.config.roller_positions + 0.003)
    record, expected = GripRecord.of(grip), roll_grip(grip, there)
    found, warm = (record.restore(there, grip.body, None, b) for b in (None, held(BOX, 0.2)))
    assert found.pose == pytest.approx(expected.pose, abs=1e-5)
    assert found.squeeze == pytest.approx(expected.squeeze, rel=1e-3)
    assert warm.state.unknowns == pytest.approx(found.state.unknowns, abs=1e-9)


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
