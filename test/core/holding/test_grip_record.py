# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A held grip that another process restores from numbers."""

from held_grips import APART, BOX, held, HOME
from isotruss_ros.core import Disc
from isotruss_ros.core.errors import GraspError, StructureError
from isotruss_ros.core.holding.grip_record import GripRecord
from isotruss_ros.core.holding.held_shape import held_joints
from isotruss_ros.core.holding.roll_grip import roll_grip, with_pressures
import pytest

TRAVEL = [0.0012, -0.002, 0.0008, 0.0016, 0.0004, -0.0008]
PRESSURES = (30e3, 31e3, 32e3)


@pytest.mark.parametrize(
    ('shape', 'angle', 'pressures'),
    [(Disc(0.3), 0.4, None), (BOX, 0.2, None), (BOX, 0.0, None), (BOX, 0.2, PRESSURES)],
)
def test_restored_grip_has_the_margins_of_the_original_and_rolls_as_it(shape, angle, pressures):
    grip = with_pressures(held(shape, angle, APART), pressures)
    for _ in range(4):  # so that its friction is not that of unknown history
        there = grip.config.roller_positions + TRAVEL
        grip = roll_grip(grip, grip.config.moved_to(there))
    restored = GripRecord.of(grip).restore(HOME, grip.body)
    assert restored.pressures == pytest.approx(grip.pressures)
    assert restored.pose == pytest.approx(grip.pose, abs=1e-12)
    assert restored.state.forces == pytest.approx(grip.state.forces, abs=1e-9)
    assert held_joints(restored) == pytest.approx(held_joints(grip), abs=1e-9)
    assert restored.sections.used == pytest.approx(grip.sections.used, abs=1e-5)
    assert restored.slip_margin(0.5) == pytest.approx(grip.slip_margin(0.5), rel=1e-3)
    there = grip.config.moved_to(grip.config.roller_positions + 0.003)
    original, copy = roll_grip(grip, there), roll_grip(restored, there)
    assert copy.pose == pytest.approx(original.pose, abs=1e-5)
    assert copy.squeeze == pytest.approx(original.squeeze, rel=1e-3)


def test_record_of_another_structure_or_object_is_refused():
    grip = held(BOX, 0.2, APART)
    record = GripRecord.of(grip)
    with pytest.raises(StructureError, match='must be 203'):
        record._replace(bent=record.bent[1:]).restore(HOME, grip.body)
    record.contacts.corners[:] = 7
    with pytest.raises(GraspError, match='no such corners'):
        record.restore(grip.config, grip.body)
