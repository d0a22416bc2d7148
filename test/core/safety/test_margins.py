# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Margins of close parts, parts that may touch the object, and limits learned from past travel."""

from types import SimpleNamespace

from held_grips import box_between, NINE
from isotruss_ros import core
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.safety.margins import object_distances, shape_margins
from isotruss_ros.core.safety.shape_guard import ShapeBounds
from isotruss_ros.core.safety.usage_limits import UsageLimits
import numpy as np
import pytest


@pytest.mark.parametrize('first', range(9))
def test_distances_leave_out_grasping_members_their_module_and_the_rods_at_its_joint(first):
    config = core.load_robot('nine_member').home
    topology = config.robot.topology
    meeting = topology.following[first]
    members = tuple(topology.member_names[i] for i in (first, meeting))
    rods = np.flatnonzero(topology.joint == topology.joint[meeting])
    count = topology.n_modules
    expected = {first, meeting, count + meeting, *(2 * count + rods)}

    distances = object_distances(config, core.ConvexObject.disc((0.0, 0.0), 0.2), members)

    assert set(np.flatnonzero(np.isinf(distances))) == expected


GRIP = box_between()


def test_a_command_ends_before_a_contact_is_lost():
    watch = core.ShapeGuard(NINE, ShapeBounds(0.0, 0.0, 0.0, 1e-6, 1e-6)).watch(NINE.home, GRIP)
    away = np.array([0.25, -0.3, 0.3, 0.2, -0.3, 0.25])
    command = RollerCommand(away, np.array([0.1, 0.2, 0.3]), 1.0, core.Status.OK)
    kept = watch.keep(command, np.zeros(len(away)), 1.0)
    assert kept.status is core.Status.SLOWED_OBJECT
    assert kept.limiting == ('the contacts of the grip',)
    assert 0.0 < kept.scale <= 0.4
    there = NINE.home.moved_to(kept.roller_velocities)
    body = core.RollingGrip.attach(NINE.home, GRIP).moved_to(there).grip.body
    assert object_distances(there, body, GRIP.members).min() >= 0.0


def test_a_shape_on_a_line_is_not_rigid():
    robot = core.load_robot('triangle')
    flat = core.Configuration(robot, np.zeros(2), robot.home.points.real + 0j)
    assert shape_margins(flat).rigidity == 0.0


PERIOD = 0.02
TRAVEL = np.array([3e-3, -4e-3])


def grasp(used):
    """Return a stand-in of an equilibrium with a utilisation of its second member."""
    robot = SimpleNamespace(member_names=('P-Q', 'Q-R'))
    config = SimpleNamespace(roller_positions=np.zeros(2), robot=robot)
    return SimpleNamespace(config=config, sections=SimpleNamespace(used=np.array([0.1, used])))


def limited(usage, way, most):
    """Return the command of a way (2,) in one period under a bound of the utilisation."""
    command = RollerCommand(way / PERIOD, np.zeros(3), 1.0, Status.OK)
    return usage.limit_utilisation(command, PERIOD, most)


def test_utilisation_uses_five_times_its_distance_per_second_at_most():
    usage = UsageLimits.of(grasp(0.5)).learned(grasp(0.7), 0.0, TRAVEL)
    command = limited(usage, TRAVEL, 1.0)
    # The same travel adds 0.2, but for the regularisation.
    assert command.scale == pytest.approx(5.0 * PERIOD * 0.3 / 0.2, rel=1e-3)
    assert (command.status, command.limiting) == (Status.SLOWED_UTILISATION, ('member Q-R',))


def test_utilisation_beyond_its_bound_may_only_fall():
    usage = UsageLimits.of(grasp(0.5)).learned(grasp(0.7), 0.0, TRAVEL)
    assert limited(usage, TRAVEL, 0.6).scale == 0.0
    assert limited(usage, -TRAVEL, 0.6).scale == 1.0


def share(usage, way, free=1.0):
    """Return the share of a way (2,) in one period by the slip margin of which `free` is free."""
    return usage.margin_share(RollerCommand(way / PERIOD, None, 1.0, Status.OK), PERIOD, free)


def test_slip_margin_decays_at_most_at_two_per_second():
    usage = UsageLimits.of(grasp(0.5)).learned(grasp(0.5), -0.1, TRAVEL)
    # As much as the last travel used, of 0.04 N.
    assert share(usage, TRAVEL) == pytest.approx(0.4, rel=1e-3)
    assert share(usage, TRAVEL, 0.5) == pytest.approx(0.2, rel=1e-3)
    assert share(usage, TRAVEL, -1.0) == 0.0
    assert share(usage, -TRAVEL) == 1.0


def test_effects_of_perpendicular_travels_are_learned_independently():
    usage, across = UsageLimits.of(grasp(0.5)), np.array([4e-3, 3e-3])
    usage = usage.learned(grasp(0.6), -0.1, TRAVEL).learned(grasp(0.8), -0.2, across)
    assert share(usage, TRAVEL) == pytest.approx(0.4, rel=1e-3)
    assert share(usage, across) == pytest.approx(0.2, rel=1e-3)
    # At most 5 times the distance of 0.2 in a second.
    assert limited(usage, TRAVEL, 1.0).scale == pytest.approx(0.1 * 0.2 / 0.1, rel=1e-3)
    assert limited(usage, across, 1.0).scale == pytest.approx(0.1 * 0.2 / 0.2, rel=1e-3)
    # What is known is not learned again.
    usage = usage.rolled(TRAVEL).learned(grasp(0.9), 0.0, TRAVEL)
    assert share(usage, TRAVEL) == pytest.approx(0.4, rel=1e-3)
