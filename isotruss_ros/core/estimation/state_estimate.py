# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settings, thresholds and result of the estimation."""

from __future__ import annotations

from dataclasses import dataclass, replace
import math
from typing import NamedTuple

from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.model.description import RobotDescription
from isotruss_ros.core.model.setting_ranges import check_settings
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.records import Record

# Thresholds of the faults of a grip, each with the runs that set it.
#
# - Loss: an innovation that is inconsistent by `MAX_DEVIATIONS` and longer than `JUMP_LENGTH`.
# - Slip: pose corrections, load and delay of more than `MAX_DEVIATIONS`, or `ASSUMED_DEVIATIONS`
#   after an assumed start, see `GripBelief.slip_deviations`.
# - Oscillation: `SWING_COUNT` half periods without decay, each larger than `MIN_SWING`, than
#   `MAX_DEVIATIONS` of the noise, and than `TRAVEL_SHARE` of the travel, see `swing_watch`.
#
# The runs of oscillations are those of the linear loop of `swing_watch` at 50 Hz, with a gain for
# omega = 12 rad/s and a damping ratio of 0.02: a heavy object has a true frequency of 0.3 omega,
# at which the loop is unstable, and a shaken one is moved by its client with omega / 2.2.

#: Number of standard deviations [-] of an inconsistent innovation, of slip, and of a swing in
#: noise. One of 60000 valid poses exceeds it. An object that slips by 30 mm/s is stopped after
#: 9 mm; after 3.6 mm with a third, but white noise of 1 mm is then reported as an oscillation 83
#: times in 20 min; after 25 mm with three times.
MAX_DEVIATIONS = 5.0
#: The same of slip after an assumed start [-]. In many assumed starts nothing is gripped: this
#: shows after 9 to 16 mm of path; with `MAX_DEVIATIONS` it shows after 24 mm.
ASSUMED_DEVIATIONS = 3.5
#: Intervals over which corrections are summed to detect slip [s]. With a third or three times, a
#: slip of 5 mm/s is reported after 7.8 or 7.9 mm instead of 7.4 mm.
SUM_INTERVALS = (0.2, 0.6, 1.5, 3.0)
#: Length of an inconsistent innovation above which the object counts as lost [m]. With a third, a
#: jump of 12 mm within the grip would be a loss; with three times, a jump of 50 mm would be a
#: slip, after which the squeeze is controlled on.
JUMP_LENGTH = 0.02
#: Lowest natural frequency that is assumed if it is unknown [rad/s].
DEFAULT_FREQUENCY = 2.4
#: Smallest difference between a maximum and a minimum of the pose, without the part by roller
#: travel, that counts as an oscillation [m]. The heavy object swings by 2.5 mm when it is stopped;
#: by 0.8 mm with a third, by 7.8 mm with three times.
MIN_SWING = 0.0015
#: The same, relative to the commanded travel since the last extremum [-]. Client-driven motion
#: with the frequency w bends the tubes by (w / omega)^2 of its amplitude, which is less for
#: motions slower than omega / 2. With a third, the shaken object is stopped 32 times in 20 s.
TRAVEL_SHARE = 0.25
#: Longest half period of an oscillation, in units of pi / omega [-], and in seconds. The gain for
#: omega makes an object swing whose true frequency is below 0.46 omega, because it is heavier than
#: in the model; in MuJoCo, with damping, below 0.23 omega. With a third of either bound, the heavy
#: object swings by 0.2 m undetected; with three times, slow drift of the estimates could count.
MAX_SWING_PHASE, MAX_SWING_TIME = 5.5, 2.0 * math.pi / DEFAULT_FREQUENCY
#: Smallest number of poses in a half period [-]; with fewer poses, a swing is not resolved. At
#: 50 Hz, neither a third nor three times changes a run.
MIN_SWING_POSES = 3
#: Number of successive half periods after which an oscillation is detected [-]. With 1, a drift to
#: and fro by 8 mm with half periods of 3.5 s is reported 17 times in 60 s; with 9, the heavy
#: object swings by 7.8 mm.
SWING_COUNT = 3
#: Smallest ratio of the amplitudes of successive half periods [-]. Swings that decay by 6 % are no
#: oscillation, swings that decay by 3.5 % are one.
MIN_SWING_RATIO = 0.95
#: Smallest return behind the last of these half periods, relative to its amplitude [-]. A pull on
#: the object and its end are two half periods; without this return they would be an oscillation
#: after any motion to and fro.
MIN_RETURN_SHARE = 0.5
#: Time at rest after an oscillation [s]; each oscillation also halves the gain.
REST_TIME = 1.0


# Settings and results of the state estimator.

#: Correlation length of slip along the travel [m].
SLIP_LENGTH = 0.1
#: Largest standard deviation of a known squeeze, relative to the squeeze [-].
MAX_KNOWN_DEVIATION = 0.5


def is_squeeze_known(squeeze: float, deviation: float) -> bool:
    """Return whether the standard deviation of a squeeze is at most half of it [N]."""
    return deviation <= MAX_KNOWN_DEVIATION * squeeze


#: Unit, smallest and largest plausible value of each setting of the estimator.
RANGES = {
    'zero_deviation': ('m', 0.0, 1.0),
    'slip': ('', 0.0, 1.0),
    'drift': ('m', 0.0, 0.1),
    'encoders': ('m', 0.0, 0.1),
    'load': ('N', 0.0, 1e3),
    'load_time': ('s', 1e-3, 60.0),
    'stiffness': ('', 0.0, 1.0),
    'joint_error': ('m', 0.0, 1.0),
    'marker_shift': ('m', 0.0, 10.0),
    'marker_turn': ('rad', 0.0, math.pi),
    'inclination': ('rad', 0.0, 0.5 * math.pi),
    'pose_error': ('m', 0.0, 1.0),
    'squeeze_error': ('', 0.0, 1.0),
}


@dataclass(frozen=True)
class EstimatorSettings:
    """
    Standard deviations of priors, process noise and measurements of the estimator.

    :ivar zero_deviation: standard deviation of the roller offsets [m]. The default is for a home
        that was not calibrated.
    :ivar slip: slip of a roller as a fraction of its travel, and of a contact as a fraction of the
        largest roller travel, independent in each 0.1 m of travel [-].
    :ivar drift: drift of the roller offsets in one second, also at rest [m].
    :ivar encoders: noise of an encoder reading [m].
    :ivar load: external wrench on a held object, moments divided by its characteristic radius [N].
    :ivar load_time: correlation time of this wrench [s].
    :ivar stiffness: relative standard deviation of the stiffness of the tubes [-]. The default is
        for a stiffness that was not measured: a factor of 0.6 to 1.5 in nine of ten robots.
    :ivar joint_error: model error of the joint positions, and mounting offset of each marker [m].
    :ivar marker_shift: common shift of all markers [m].
    :ivar marker_turn: common rotation of all markers about the origin of the robot frame [rad].
    :ivar inclination: largest possible inclination of the robot's plane [rad]. The default is that
        of an upright robot.
    :ivar pose_error: model error of the object's pose, rotations times the characteristic
        radius [m].
    :ivar squeeze_error: relative model error of the squeeze [-].
    """

    zero_deviation: float = 0.01
    slip: float = 0.02
    drift: float = 3e-4
    encoders: float = 1e-4
    load: float = 2.0
    load_time: float = 0.3
    stiffness: float = 0.3
    joint_error: float = 5e-4
    marker_shift: float = 5e-3
    marker_turn: float = 0.035
    inclination: float = 0.5 * math.pi
    pose_error: float = 5e-4
    squeeze_error: float = 0.04

    def __post_init__(self) -> None:
        """Raise ConfigurationError if a number is out of its range."""
        check_settings(self, RANGES, ConfigurationError)

    def calibrated(
        self, description: RobotDescription, zero_deviation: float | None = None
    ) -> EstimatorSettings:
        """
        Return the settings with the calibrated deviations of stiffness and roller offsets.

        :param zero_deviation: standard deviation of the offsets [m]; None: the largest one of the
            robot file.
        """
        block = description.calibration
        if zero_deviation is None:
            zeros = block.get('zero_deviations', {}).values()
            zero_deviation = max(zeros, default=self.zero_deviation)
        stiffness = block.get('stiffness_deviation', self.stiffness)
        return replace(self, stiffness=stiffness, zero_deviation=zero_deviation)


@dataclass(frozen=True, eq=False, repr=False)
class StateEstimate(Record, headline=('travel', 'pose', 'squeeze', 'left_out', 'slipping')):
    """
    Estimate of configuration, object pose and squeeze, with their covariances.

    :ivar time: time of the encoder readings [s].
    :ivar offsets: (r,) roller offsets, to be added to the encoder readings [m].
    :ivar offset_covariance: (r, r) covariance of the offsets [m^2].
    :ivar travel: (r,) corrected roller travel [m].
    :ivar joints: (j, 2) positions of the joints under the contact forces, in
        `Topology.joint_names` order [m].
    :ivar joint_covariance: (2j, 2j) covariance of (x0, y0, x1, y1, ...) [m^2].
    :ivar pose: pose (x, y, angle) of the held object [m, rad]; None if no object is held according
        to the model.
    :ivar pose_covariance: (3, 3) covariance of the pose [m^2, m rad, rad^2].
    :ivar squeeze: mean normal force of the members [N]; NaN if no object is held according to the
        model.
    :ivar squeeze_deviation: standard deviation of the squeeze, including the error of the
        stiffness [N].
    :ivar used: sorted names of the joints whose last marker was accepted.
    :ivar left_out: sorted names of the joints whose last marker was rejected.
    :ivar is_improbable: whether offsets and marker errors exceed their prior deviations, see
        `OffsetFilter`; then the offsets are unknown.
    :ivar may_be_upright: whether the markers admit the largest `inclination`, at which the weight
        changes an offset by more than its deviation. The squeeze is then unknown.
    :ivar swapped: names of two joints whose markers are apparently swapped; empty otherwise.
    :ivar slipping: names of slipping rollers, in `Robot.roller_names` order.
    :ivar delay: time by which the measured poses are older than their stamps say [s].
    """

    time: float
    offsets: Array
    offset_covariance: Array
    travel: Array
    joints: Array
    joint_covariance: Array
    pose: Array | None = None
    pose_covariance: Array | None = None
    squeeze: float = math.nan
    squeeze_deviation: float = math.nan
    used: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    is_improbable: bool = False
    may_be_upright: bool = False
    swapped: tuple[str, ...] = ()
    slipping: tuple[str, ...] = ()
    delay: float = 0.0


class EstimatedTravel(NamedTuple):
    """Estimated roller offsets with the covariance of the offsets, for a control loop."""

    offsets: Array  #: (r,) roller offsets, to be added to the encoder readings [m]
    covariance: Array  #: (r, r) covariance of the offsets [m^2]
