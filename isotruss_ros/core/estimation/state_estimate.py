# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settings and results of the state estimator."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.records import Record

#: Largest standard deviation of a known squeeze, relative to the squeeze [-].
MAX_KNOWN_DEVIATION = 0.5


@dataclass(frozen=True)
class EstimatorSettings:
    """Prior standard deviations and noise of the estimator's states."""

    #: standard deviation of the roller offsets [m]; 1 mm after calibration with markers
    zeros: float = 0.01
    #: slip of a roller as a share of its travel, independent in each 0.1 m of travel [-]
    slip: float = 0.02
    drift: float = 3e-4  #: drift of the offsets per second, also at rest [m]
    encoders: float = 1e-4  #: noise of an encoder reading [m]
    load: float = 2.0  #: wrench on a held object, moments over its characteristic radius [N]
    load_time: float = 0.3  #: correlation time of the wrench [s]
    stiffness: float = 0.05  #: relative error of the stiffness of robot and tubes [-]
    joint_error: float = 5e-4  #: model error of the joints, and mounting offset of each marker [m]
    marker_shift: float = 3e-3  #: common shift of all markers [m]
    marker_turn: float = 3e-3  #: common rotation of all markers [rad]
    #: model error of the pose, rotations times the characteristic radius [m]
    pose_error: float = 5e-4
    squeeze_error: float = 0.04  #: relative model error of the squeeze [-]


@dataclass(frozen=True, eq=False, repr=False)
class StateEstimate(Record, headline=('travel', 'pose', 'squeeze', 'left_out', 'slipping')):
    """Estimate of configuration, object pose and squeeze, with their covariances."""

    time: float  #: time of the encoder readings [s]
    offsets: Array  #: (r,) roller offsets, to be added to the encoder readings [m]
    offset_covariance: Array  #: (r, r) covariance of the offsets [m^2]
    travel: Array  #: (r,) corrected roller travel [m]
    #: (j, 2) positions of the joints under the contact forces, in `Topology.joint_names` order [m]
    joints: Array
    joint_covariance: Array  #: (2j, 2j) covariance of (x0, y0, x1, y1, ...) [m^2]
    #: pose (x, y, angle) of the held object [m, rad]; None if the model does not hold it
    pose: Array | None = None
    pose_covariance: Array | None = None  #: (3, 3) covariance of the pose [m^2, m rad, rad^2]
    #: mean normal force of the members [N]; NaN if the model does not hold an object
    squeeze: float = math.nan
    #: standard deviation of the squeeze, with the stiffness error [N]
    squeeze_deviation: float = math.nan
    used: tuple[str, ...] = ()  #: names of the joints whose last markers were accepted, sorted
    left_out: tuple[str, ...] = ()  #: names of the joints whose last markers were rejected, sorted
    #: names of two joints whose markers are apparently swapped; empty otherwise
    swapped: tuple[str, ...] = ()
    slipping: tuple[str, ...] = ()  #: names of slipping rollers, in `Robot.roller_names` order
    delay: float = 0.0  #: delay of the poses beyond their stamps [s]


class EstimatedTravel(NamedTuple):
    """Estimated roller offsets for a control loop."""

    offsets: Array  #: (r,) roller offsets, to be added to the encoder readings [m]
    covariance: Array  #: (r, r) covariance of the offsets [m^2]
