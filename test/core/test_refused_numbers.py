# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers that are not finite, or of no size that there is, are refused in words."""

from isotruss_ros.calibration.home import calibrate_home
from isotruss_ros.calibration.home_fit import Posture
from isotruss_ros.calibration.oscillation import fit_oscillation
from isotruss_ros.calibration.roller_check import judge_roller
from isotruss_ros.calibration.stiffness_scale import calibrate_stiffness
from isotruss_ros.core import (
    ConvexObject,
    Grip,
    IsotrussError,
    load_robot,
    ObjectPath,
    PathTracker,
    Pose,
    reach_pose,
    tangent_center,
)
from isotruss_ros.core.paths.path_tracking import TrackingSettings
from isotruss_ros.core.planning.foresee_path import foresee_grip
import numpy as np
import pytest

ROBOT = load_robot('nine_member')
HOME, NONE = ROBOT.home, np.zeros(len(ROBOT.roller_names))
BODY = ConvexObject.disc(tangent_center(HOME, 'north/Z', 0.3, 0.02), 0.3)
GRIP = Grip.at_module(ROBOT, 'north/Z', BODY, 0.8)
TRACKER = PathTracker(ObjectPath([(0, 0, 0), (0.1, 0, 0)], 0.05, 0.5), TrackingSettings(), 0.01)
POSES = np.array([BODY.pose, BODY.pose])
TIMES, SWING = np.linspace(0.0, 3.0, 40), np.zeros((40, 3))


def put(values, value):
    """Return values (n, 3), one of which is another number."""
    changed = np.array(values, dtype=float)
    changed[-1, -1] = value
    return changed


CALLS = {
    'pose of a path': lambda value: TRACKER.update(Pose(0.0, 0.0, value), 0.0, 0.01),
    'pose to reach': lambda value: reach_pose(HOME, GRIP, (0.7, value, 0.0)),
    'path in the model': lambda value: foresee_grip(HOME, BODY, 0.8, put(POSES, value)),
    'oscillation': lambda value: fit_oscillation(TIMES, put(SWING, value), 0.15),
    'joints': lambda value: calibrate_home(ROBOT, [Posture(NONE, {'P': (0.0, value)})]),
    'pull': lambda value: calibrate_stiffness(
        HOME, {'Z': (value, 0.0)}, {'Z': (0.0, 0.0)}, {'Z': (0.01, 0.0)}
    ),
    'displacement': lambda value: judge_roller(HOME, 'north/R', 0.01, {'Z': (value, 0.0)}, 1e-3),
}


@pytest.mark.parametrize('what', CALLS)
@pytest.mark.parametrize('value', [np.inf, -np.inf, np.nan, 1e300])
def test_numbers_without_sense_are_refused(what, value):
    with pytest.raises(IsotrussError, match='finite'):
        CALLS[what](value)


@pytest.mark.parametrize('postures', [[], [Posture(NONE, {})]])
def test_homes_need_measured_joints(postures):
    with pytest.raises(IsotrussError, match='joints none: must be'):
        calibrate_home(ROBOT, postures)
