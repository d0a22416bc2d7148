# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Grips of any members near their bounds, and what else is rare in the shapes of a robot."""

from held_grips import box_between, NINE
from isotruss_ros.core import Configuration, load_robot, RollingGrip, ShapeGuard, Status
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.safety.margins import object_distances, shape_margins
from isotruss_ros.core.safety.shape_guard import ShapeBounds
import numpy as np

GRIP = box_between()
REST = np.zeros(len(NINE.roller_names))


def watched(min_object_clearance, clearance_band=1e-6):
    """Return what watches the box at home, and its limit by the object's distance."""
    bounds = ShapeBounds(0.0, 0.0, min_object_clearance, 1e-6, clearance_band)
    watch = ShapeGuard(NINE, bounds).watch(NINE.home, GRIP)
    near = [limit for limit in watch.limits if limit.barrier.needs_object]
    return watch, near[0] if near else None


def command(velocities):
    """Return a command of roller velocities."""
    return RollerCommand(np.array(velocities), np.array([0.1, 0.2, 0.3]), 1.0, Status.OK)


def distances_after(travel):
    """Return the distances from the box after some roller travel [m]."""
    there = NINE.home.moved_to(travel)
    return object_distances(
        there, RollingGrip.attach(NINE.home, GRIP).moved_to(there).grip.body, GRIP.members
    )


def test_a_command_ends_before_a_contact_is_lost():
    watch, _ = watched(0.0)
    away = np.array([0.25, -0.3, 0.3, 0.2, -0.3, 0.25])
    found = watch.keep(command(away), REST, 1.0)
    assert found.status is Status.SLOWED_OBJECT
    assert found.limiting == ('the contacts of the grip',)
    assert 0.0 < found.scale <= 0.4
    assert distances_after(found.roller_velocities).min() >= 0.0


def test_a_shape_on_a_line_is_not_rigid():
    robot = load_robot('triangle')
    flat = Configuration(robot, np.zeros(2), robot.home.points.real + 0j)
    assert shape_margins(flat).rigidity == 0.0
