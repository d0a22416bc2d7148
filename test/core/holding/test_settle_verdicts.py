# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What `settle_grasp` says of an equilibrium, at both sides of each of its bounds."""

from types import SimpleNamespace

from held_grips import BOX, HOME
from isotruss_ros.core import ConvexObject, HoldStatus, place_between, Polygon, Pose, settle_grasp
from isotruss_ros.core.holding import settle_grasp as settle_grasp_module
from isotruss_ros.core.holding.settle_grasp import assess_equilibrium
import numpy as np
import pytest

DIAMETER = HOME.robot.description.tube_diameter
NAMES = HOME.robot.member_names


def judge(shift=0.0, other=-0.01, needed=0.3, friction=0.5, stable=True, used=0.5):
    """Judge an equilibrium of the first two members; another one is as deep in the object."""
    found = SimpleNamespace(
        config=HOME,
        body=ConvexObject.disc((shift, 0.0), 0.3),
        members=np.arange(2),
        required_friction=needed,
        hold=lambda mu: HoldStatus.SLIPS if needed > mu else HoldStatus.HELD,
        response=SimpleNamespace(stable=stable),
        sections=SimpleNamespace(used=np.full(len(NAMES), used)),
    )
    with pytest.MonkeyPatch.context() as patch:
        others = np.array([4]), np.array([other])
        patch.setattr(settle_grasp_module, 'depths_in_others', lambda _: others)
        settled = assess_equilibrium(Pose(0.0, 0.0, 0.0), found, friction)
        return settled.hold, settled.reason


@pytest.mark.parametrize(
    ('given', 'hold', 'words'),
    [
        ({}, HoldStatus.HELD, ''),
        ({'shift': 0.249 * DIAMETER}, HoldStatus.HELD, ''),
        ({'shift': 0.251 * DIAMETER}, HoldStatus.FAR, f'{251.0 * DIAMETER:.3g} mm'),
        ({'other': 0.001}, HoldStatus.OTHER_CONTACT, NAMES[4]),
        ({'needed': 0.5}, HoldStatus.HELD, ''),
        ({'needed': 0.51}, HoldStatus.SLIPS, '0.51 against 0.5'),
        ({'stable': False}, HoldStatus.UNSTABLE, ''),
        ({'used': 1.0}, HoldStatus.HELD, ''),
        ({'used': 1.01}, HoldStatus.WRINKLES, f'{NAMES[0]} has 1.01 times its wrinkling moment'),
        ({'shift': 1.0, 'other': 0.1, 'stable': False}, HoldStatus.FAR, 'too far'),
    ],
)
def test_an_equilibrium_holds_within_all_bounds(given, hold, words):
    found, reason = judge(**given)
    assert found is hold
    assert words in reason
    assert (reason == '') == (hold is HoldStatus.HELD)


def test_displacement_of_the_angle_is_below_half_a_turn():
    members = ('south/P-Q', 'north/R-P')
    grip = place_between(HOME, members, BOX, angle=0.0, indentation=0.01)
    body, found = grip.body, settle_grasp(HOME, grip.body, 5.0, members=members)
    assert found.held
    assert 1e-6 < abs(found.displacement[2]) < 0.1
    # The box looks the same after half a turn: the angles are just at that.
    shape = Polygon([(-x, -y) for x, y in BOX.vertices], corner_radius=0.02)
    half = 0.5 * found.displacement[2]
    for angle in (np.pi - abs(half), -np.pi + abs(half)):
        placed = ConvexObject(shape, (*body.pose[:2], angle))
        again = settle_grasp(HOME, placed, 5.0, members=members)
        assert abs(again.displacement[2]) < 0.1
        assert again.displacement[2] == pytest.approx(
            found.pose.angle - (angle - np.copysign(np.pi, angle)), abs=1e-3
        )
