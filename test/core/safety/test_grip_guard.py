# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Loss of contact in a long command, and singular configurations."""

from held_grips import box_between, NINE
from isotruss_ros.core import Configuration, load_robot, RollingGrip, ShapeGuard, Status
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.safety.margins import object_distances, shape_margins
from isotruss_ros.core.safety.shape_guard import ShapeBounds
import numpy as np

GRIP = box_between()


def distances_after(travel):
    """Return the distances from the box after some roller travel [m]."""
    there = NINE.home.moved_to(travel)
    return object_distances(
        there, RollingGrip.attach(NINE.home, GRIP).moved_to(there).grip.body, GRIP.members
    )


def test_a_command_ends_before_a_contact_is_lost():
    watch = ShapeGuard(NINE, ShapeBounds(0.0, 0.0, 0.0, 1e-6, 1e-6)).watch(NINE.home, GRIP)
    away = np.array([0.25, -0.3, 0.3, 0.2, -0.3, 0.25])
    command = RollerCommand(away, np.array([0.1, 0.2, 0.3]), 1.0, Status.OK)
    found = watch.keep(command, np.zeros(len(away)), 1.0)
    assert found.status is Status.SLOWED_OBJECT
    assert found.limiting == ('the contacts of the grip',)
    assert 0.0 < found.scale <= 0.4
    assert distances_after(found.roller_velocities).min() >= 0.0


def test_a_shape_on_a_line_is_not_rigid():
    robot = load_robot('triangle')
    flat = Configuration(robot, np.zeros(2), robot.home.points.real + 0j)
    assert shape_margins(flat).rigidity == 0.0
