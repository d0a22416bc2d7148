# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robots and grasps drawn in one call."""

from isotruss_ros.core import ConvexObject, load_robot, settle_grasp, tangent_center
from isotruss_ros.plotting import plot_grasp, plot_robot
from isotruss_ros.plotting.grasp_drawing import describe_contacts
from matplotlib.figure import Figure
import pytest

ROBOT = load_robot('nine_member')
CENTER = tangent_center(ROBOT.home, 'north/Z', 0.3, 0.01)
BODY = ConvexObject.disc(CENTER, 0.3)


@pytest.fixture
def axes():
    return Figure().add_subplot()


def test_a_robot_drawn_on_axes_keeps_their_limits(axes):
    axes.set_xlim(-7.0, 7.0)
    assert plot_robot(ROBOT.home, axes) is axes
    assert axes.get_xlim() == (-7.0, 7.0)
    # A tube, its corner, the rod and the bar between the pinch points of each module.
    assert len(axes.patches) == 4 * len(ROBOT.module_names)


def test_a_grasp_is_drawn_with_its_forces_and_contact_lengths(axes):
    grip = settle_grasp(ROBOT.home, BODY, 0.8).equilibrium
    assert plot_grasp(grip, axes) is axes
    assert axes.get_title() == describe_contacts(grip)
    x = axes.get_xlim()
    assert 0.5 * (x[0] + x[1]) == pytest.approx(CENTER[0])
    # One arrow for each member that presses.
    assert len(axes.texts) == len(grip.member_names)
