# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Limits of slip margin and utilisation from the effect of past travel."""

from types import SimpleNamespace

from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.safety.usage_limits import UsageLimits
import numpy as np
import pytest

PERIOD = 0.02
TRAVEL = np.array([3e-3, -4e-3])


def grasp(used):
    """Return a stand-in of an equilibrium with a utilisation of its second member."""
    config = SimpleNamespace(
        roller_positions=np.zeros(2), robot=SimpleNamespace(member_names=('P-Q', 'Q-R'))
    )
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
    usage = usage.learned(grasp(0.9), -0.1, TRAVEL)
    assert share(usage, TRAVEL) == pytest.approx(0.4, rel=1e-3)
