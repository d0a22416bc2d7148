# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Texts of decisions: deviations of a command from its twist, and the squeeze."""

from isotruss_ros.core import Status
from isotruss_ros.core.errors import ConfigurationError, GraspError, IsotrussError
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.servo.decision import describe, describe_squeeze, halt_for
import numpy as np
import pytest

UNREACHABLE = 'the closest {} is (0.01, 0.02) m/s, 0.3 rad/s'


def told(status, scale=1.0, limiting=(), keeps_contacts=True):
    """Return the text about a command."""
    achieved = np.array([0.01, 0.02, 0.3])
    return describe(RollerCommand(np.ones(6), achieved, scale, status, limiting), keeps_contacts)


@pytest.mark.parametrize('status', [Status.OK, Status.SLOWED_BARRIER, Status.SLIDING])
def test_a_command_of_the_whole_twist_needs_no_words(status):
    assert told(status) == ''


@pytest.mark.parametrize('status', [Status.HALT_NO_TWIST, Status.HALT_SLIPPED])
def test_halts_have_a_message_of_their_own(status):
    assert told(status, 0.0) == ''


def test_the_closest_twist_to_an_unreachable_one_is_named():
    which = 'one that keeps the contacts'
    assert told(Status.UNREACHABLE) == (
        f'the twist is unreachable or would break contacts; {UNREACHABLE.format(which)}'
    )
    assert told(Status.UNREACHABLE, keeps_contacts=False) == (
        f'the twist is unreachable; {UNREACHABLE.format("reachable one")}'
    )


@pytest.mark.parametrize(
    ('status', 'how'),
    [
        (Status.SLOWED_OBJECT, 'slowed to'),
        (Status.HALT_NO_TWIST - 1, 'slowed to'),
        (Status.SLIDING, 'sliding with'),
    ],
)
def test_the_remaining_share_of_a_twist_is_named_with_its_limits(status, how):
    assert told(status, 0.25, ('a', 'b')) == f'{how} 25 % by the limits of a, b'
    assert told(status, 0.999).startswith(f'{how} 99.9 %: more would need roller speeds')


def test_unreachable_and_slowed_are_both_named():
    text = told(Status.UNREACHABLE, 0.5, ('a',))
    assert text.endswith('0.3 rad/s; slowed to 50 % by the limits of a')


def test_a_squeeze_with_a_deviation_above_its_half_is_unknown():
    assert describe_squeeze(10.0, 5.0) == 'squeeze 10.0 N, deviation 5.0 N'
    assert describe_squeeze(10.0, 5.1).startswith('squeeze unknown: 10.0 N, deviation 5.1 N; ')


def test_an_assumed_squeeze_is_unknown_with_its_remedy():
    text = describe_squeeze(10.0, 10.4, is_assumed=True)
    assert text.startswith('squeeze unknown: 10.0 N, deviation 10.4 N, assumed')
    assert 'close the grip further before carrying' in text


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
