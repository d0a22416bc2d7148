# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What an estimator of the robot's state is told, and what it tells."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.records import Record

#: A squeeze whose deviation is a larger share of it is not known [-].
UNKNOWN_SHARE = 0.5


@dataclass(frozen=True)
class EstimatorSettings:
    """
    What is known of the robot before anything is measured: standard deviations.

    :ivar zeros: of the rollers' zeros; 1 mm after homing with markers [m].
    :ivar slip: of the share of its travel that a roller slips, over each 0.1 m anew [-].
    :ivar drift: of the zeros in a second, also at rest [m].
    :ivar encoders: of a reading [m].
    :ivar load: of the wrench on a held object, moments over its arm [N].
    :ivar load_time: for so long the wrench stays about the same [s].
    :ivar stiffness: of the stiffness of robot and tubes against the model's [-].
    :ivar joint_error: of the model of the joints, and of where each marker is mounted [m].
    :ivar marker_shift: of the common shift of all markers [m].
    :ivar marker_turn: of their common turn [rad].
    :ivar pose_error: of the model of the object's pose, turns times its arm [m].
    :ivar squeeze_error: of the model of the squeeze, as a share of it [-].
    """

    zeros: float = 0.01
    slip: float = 0.02
    drift: float = 3e-4
    encoders: float = 1e-4
    load: float = 2.0
    load_time: float = 0.3
    stiffness: float = 0.05
    joint_error: float = 5e-4
    marker_shift: float = 3e-3
    marker_turn: float = 3e-3
    pose_error: float = 5e-4
    squeeze_error: float = 0.04


@dataclass(frozen=True, eq=False, repr=False)
class StateEstimate(Record, headline=('travel', 'pose', 'squeeze', 'left_out', 'slipping')):
    """
    Where robot and object are, how hard it squeezes, and how sure that is.

    :ivar time: of the encoders that it is for [s].
    :ivar offsets: (r,) to add to the readings of the encoders for the roller travel [m].
    :ivar offset_covariance: (r, r) [m^2].
    :ivar travel: (r,) corrected roller travel [m].
    :ivar joints: (j, 2) in `Topology.joint_names` order, displaced by what is held [m].
    :ivar joint_covariance: (2j, 2j) of (x0, y0, x1, y1, ...) [m^2].
    :ivar pose: (x, y, angle) of the held object [m, rad]; None where none is held in the model.
    :ivar pose_covariance: (3, 3) [m^2, m rad, rad^2].
    :ivar squeeze: mean normal force of the members [N]; no number where no object is held in the
        model.
    :ivar squeeze_deviation: its standard deviation, that of the stiffness included [N].
    :ivar used: names of the joints whose last markers count, sorted.
    :ivar left_out: of those whose last markers do not fit, sorted.
    :ivar swapped: names of two joints whose markers seem to be swapped; empty if none are.
    :ivar slipping: names of the rollers that seem to slip, in `Robot.roller_names` order.
    :ivar delay: of the poses beyond their stamps [s].
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
    swapped: tuple[str, ...] = ()
    slipping: tuple[str, ...] = ()
    delay: float = 0.0


class EstimatedTravel(NamedTuple):
    """
    What a control loop takes from an estimate.

    :ivar offsets: (r,) to add to the readings of the encoders [m].
    :ivar covariance: (r, r) of these [m^2].
    """

    offsets: Array
    covariance: Array
