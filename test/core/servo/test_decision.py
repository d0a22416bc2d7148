# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Texts of decisions: deviations of a command from its twist, and the squeeze."""

from isotruss_ros.core import Status
from isotruss_ros.core.errors import ConfigurationError, GraspError, IsotrussError
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.servo.decision import describe, describe_squeeze, halt_for
import numpy as np
import pytest

CLOSEST = (
    'the twist is unreachable or would break contacts; '
    'the closest one that keeps the contacts is (0.01, 0.02) m/s, 0.3 rad/s'
)


@pytest.mark.parametrize(
    ('status', 'scale', 'limiting', 'text'),
    [
        (Status.OK, 1.0, (), ''),
        (Status.SLOWED_BARRIER, 1.0, (), ''),
        (Status.HALT_NO_TWIST, 0.0, (), ''),
        (Status.SLOWED_OBJECT, 0.25, ('a', 'b'), 'slowed to 25 % by the limits of a, b'),
        (Status.HALT_NO_TWIST - 1, 0.25, ('a',), 'slowed to 25 % by the limits of a'),
        (Status.SLIDING, 0.25, ('a',), 'sliding with 25 % by the limits of a'),
        (Status.UNREACHABLE, 1.0, (), CLOSEST),
        (Status.UNREACHABLE, 0.5, ('a',), f'{CLOSEST}; slowed to 50 % by the limits of a'),
    ],
)
def test_the_message_names_the_closest_twist_and_the_remaining_share(
    status, scale, limiting, text
):
    command = RollerCommand(np.ones(6), np.array([0.01, 0.02, 0.3]), scale, status, limiting)
    assert describe(command, True) == text
    if text.startswith(CLOSEST):  # a joint has no contacts
        assert describe(command, False).startswith('the twist is unreachable; the closest reach')


def test_a_squeeze_with_a_deviation_above_its_half_is_unknown():
    assert describe_squeeze(10.0, 5.0) == 'squeeze 10.0 N, deviation 5.0 N'
    assert describe_squeeze(10.0, 5.1).startswith('squeeze unknown: 10.0 N, deviation 5.1 N; ')


@pytest.mark.parametrize(
    ('error', 'status'),
    [
        (GraspError('no contact'), Status.HALT_NO_GRASP),
        (ConfigurationError('singular'), Status.HALT_KINEMATICS),
        (IsotrussError('other'), Status.HALT_KINEMATICS),
    ],
)
def test_errors_of_the_solver_have_the_status_of_their_kind(error, status):
    assert halt_for(error) is status
