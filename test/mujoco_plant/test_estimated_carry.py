# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Estimated squeeze of carries in MuJoCo with wrong roller offsets and slipping rollers."""

from mujoco_worlds import needs_mujoco
import pytest
from studies.comparison.estimated_carries import carry, SIX, THREE
from studies.comparison.random_carries import BOX, DISC

pytestmark = [needs_mujoco, pytest.mark.nightly]
#: Each object, each set of joints, and each stiffness at least once.
CASES = [(BOX, SIX, 1.0), (BOX, THREE, 0.6), (DISC, THREE, 1.5)]


@pytest.mark.parametrize(('kind', 'names', 'stiffness'), CASES)
def test_squeeze_with_estimated_offsets_is_the_desired_one(kind, names, stiffness):
    result = carry(kind, 2, names, stiffness)
    # Three markers do not separate the offsets from a rotation of their frame (2 degrees).
    squeeze, worst, joints = (0.1, 0.2, 1.5e-3) if names is SIX else (0.2, 0.25, 9e-3)
    assert abs(result.squeeze) < squeeze
    assert result.worst < worst
    assert abs(result.surprise) < 3.0
    assert result.joints < joints
    assert result.encoders > 4.0 * result.joints


def test_squeeze_with_encoders_alone_is_wrong():
    assert abs(carry(DISC, 2, (), fed=False).squeeze) > 0.1
