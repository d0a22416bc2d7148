# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Request for a grasp analysis, and the result or the reason why there is none."""

from __future__ import annotations

from dataclasses import dataclass
import enum
import math
from typing import NamedTuple

from isotruss_ros.core.fixed_object.analyze_grasp import GraspAnalysis
from isotruss_ros.core.holding.settled_grasp import SettledGrasp
from isotruss_ros.core.inputs import InputFault
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject


class GraspCode(enum.IntEnum):
    """Codes of grasp reports, equal to the codes of isotruss_msgs/GraspState."""

    OK = 0
    WRINKLED = 1  #: a tube wrinkles, so the result is outside of the model's validity
    NO_JOINT_STATES = 10
    STALE_JOINT_STATES = 11
    INVALID_JOINT_STATES = 12
    NO_OBJECT_POSE = 20
    STALE_OBJECT_POSE = 21
    INVALID_OBJECT_POSE = 22
    # It cannot be missing: before the first message the wrench is zero.
    STALE_EXTERNAL_WRENCH = 31
    INVALID_EXTERNAL_WRENCH = 32
    # They cannot be missing: before the first messages those of the robot file are used.
    STALE_TUBE_PRESSURES = 36
    INVALID_TUBE_PRESSURES = 37
    NO_CONFIGURATION = 40  #: no configuration exists at the roller positions
    MECHANISM = 41  #: the robot is a mechanism, or its stiffness laws contradict each other
    NOT_SOLVED = 42  #: the solver of contact or friction failed
    INVALID_REQUEST = 50  #: a number of the request is invalid

    def __str__(self) -> str:
        """Return the name of the code in lower case, with spaces."""
        return self.name.lower().replace('_', ' ')


#: Code of a report for the name and the fault of an input.
INPUT_CODES = {
    (name, fault): GraspCode[code]
    for name in ('joint_states', 'object_pose', 'external_wrench', 'tube_pressures')
    for fault, prefix in zip(InputFault, ('NO', 'STALE', 'INVALID'), strict=True)
    if (code := f'{prefix}_{name.upper()}') in GraspCode.__members__
}


class GraspQuery(NamedTuple):
    """Arguments of a grasp analysis, from a request or from parameters."""

    roller_positions: tuple[float, ...]  #: (r,) roller travel since home [m]
    body: ConvexObject  #: the object at its measured pose
    friction: float  #: coefficient of friction between tube and object
    #: wrench (fx, fy, m) on the object about the origin of its frame [N, N m]
    external_wrench: tuple[float, float, float]
    spacing: float  #: spacing of the contact points of the fixed object along the tubes [m]
    #: (t,) gauge pressures of the tubes in the order of the robot file [Pa]; None: the pressures
    #: of the robot file are used
    pressures: tuple[float, ...] | None = None


@dataclass(frozen=True, eq=False)
class AnalyzedGrasp:
    """Inputs and results of one grasp analysis."""

    config: Configuration  #: configuration of the robot
    body: ConvexObject  #: the object
    analysis: GraspAnalysis  #: analysis of the fixed object at the measured pose
    settled: SettledGrasp  #: equilibrium of the free object near the measured pose
    computing_time: float  #: computing time of configuration and analysis [s]
    #: chance that the object is held, see `Uncertainty`; NaN if files have no uncertainty
    chance: float = math.nan

    @property
    def largest_utilisation(self) -> float:
        """Return the largest utilisation of a member [-]; 0 without an equilibrium."""
        grip = self.settled.equilibrium
        return 0.0 if grip is None else float(grip.sections.used.max())


@dataclass(frozen=True)
class GraspReport:
    """Result of a grasp analysis, or the reason why there is none."""

    #: OK for a valid result, WRINKLED for a result for which the model does not hold, otherwise
    #: the reason why there is no result
    code: GraspCode
    message: str  #: warnings, or the reason why there is no result; may be empty
    time: float  #: time of the oldest input, or time of the call if there is no result [s]
    grasp: AnalyzedGrasp | None = None  #: result of the analysis, if there is one
    #: standard deviation of the squeeze by the control loop that holds the object [N]; NaN without
    squeeze_deviation: float = math.nan
    is_squeeze_assumed: bool = False  #: whether this loop assumes the equilibrium

    @property
    def held(self) -> bool | None:
        """Return whether the object is held, see `settle_grasp`; None without a result."""
        if self.grasp is None:
            return None
        return self.code is GraspCode.OK and self.grasp.settled.held

    @property
    def force_closure(self) -> bool:
        """Return whether the free object has force closure, see `SettledGrasp.force_closure`."""
        return self.grasp is not None and self.grasp.settled.force_closure
