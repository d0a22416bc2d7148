# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What is taken where nothing is said: the numbers that the documentation has."""

from isotruss_ros.core import load_robot, ObjectPath, TwistServo
from isotruss_ros.core.control.path_tracking import (
    RETURN,
    RETURN_SPEED,
    RETURN_TURN_RATE,
    TrackingSettings,
)
from isotruss_ros.core.control.roller_trajectory import RollerTrackingSettings
from isotruss_ros.core.control.squeeze_control import SqueezeSettings


def test_paths_are_followed_with_these_settings():
    assert vars(TrackingSettings()) == {
        'position_tolerance': 0.01,
        'angle_tolerance': 0.2,
        'position_gain': 2.0,
        'angle_gain': 2.0,
        'ramp_time': 0.5,
        'progress_timeout': 3.0,
        'free_share': 0.5,
        'standing_share': 0.9,
        'reached_share': 0.5,
        'max_correction': 0.5,
        'min_rate': 0.1,
        'standstill_rate': 0.05,
    }


def test_objects_are_brought_back_slowly_and_to_a_quarter_of_a_centimetre():
    assert RETURN.position_tolerance == 0.0025
    assert (RETURN_SPEED, RETURN_TURN_RATE) == (0.002, 0.02)


def test_roller_trajectories_are_followed_with_these_settings():
    assert vars(RollerTrackingSettings()) == {
        'gain': 5.0,
        'start_tolerance': 0.01,
        'tolerance': 2e-5,
        'settling_time': 0.1,
        'max_lag': 5e-3,
        'max_step': 0.2,
        'progress_timeout': 3.0,
    }


def test_the_squeeze_is_controlled_with_these_settings():
    settings = dict(vars(SqueezeSettings(20.0, 0.5)))
    assert vars(settings.pop('load')) == {'size': 5.0, 'pose_error': 3e-4, 'time': 0.02}
    assert settings == {
        'force': 20.0,
        'friction': 0.5,
        'gain': 5.0,
        'max_force_rate': 10.0,
        'pose_gain': 20.0,
        'bias_gain': 2.0,
        'min_slip_margin': 0.0,
        'max_utilisation': 1.0,
        'utilisation_rate': 5.0,
    }


def test_tubes_hold_objects_by_half_of_the_normal_force_where_nothing_is_known():
    assert TwistServo(load_robot('triangle'), 'main/T', 0.3, 0.02, 0.1).friction == 0.5


def test_smooth_paths_are_cut_into_pieces_of_half_a_centimetre_and_a_fiftieth_of_a_radian():
    for end in ((0.0999, 0.0, 0.0), (0.0, 0.0, 0.3999)):
        path = ObjectPath([(0.0, 0.0, 0.0), end], 0.1, 0.1, smooth=True)
        assert len(path.poses) == 21
