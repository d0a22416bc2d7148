# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A question about a grasp, and the answer, or why there is none."""

from __future__ import annotations

from dataclasses import dataclass
import enum
from typing import NamedTuple

from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis
from isotruss_ros.core.holding.settled_grasp import SettledGrasp
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject


class GraspCode(enum.IntEnum):
    """Whether there is an answer; the same codes as in isotruss_msgs/GraspState."""

    OK = 0
    WRINKLED = 1  #: there is an answer, outside of the model: a tube wrinkles
    NO_JOINT_STATES = 10
    STALE_JOINT_STATES = 11
    INVALID_JOINT_STATES = 12
    NO_OBJECT_POSE = 20
    STALE_OBJECT_POSE = 21
    INVALID_OBJECT_POSE = 22
    # One that was never published is zero: it cannot be missing.
    STALE_EXTERNAL_WRENCH = 31
    INVALID_EXTERNAL_WRENCH = 32
    # Those that were never published are those of the robot file.
    STALE_TUBE_PRESSURES = 36
    INVALID_TUBE_PRESSURES = 37
    NO_CONFIGURATION = 40  #: the roller positions fit no shape of the robot
    MECHANISM = 41  #: the robot cannot carry loads, or its stiffness laws are contradictory
    NOT_SOLVED = 42  #: the contact or the friction problem was not solved
    INVALID_REQUEST = 50  #: a number of the question cannot be used

    def __str__(self) -> str:
        """Return the name in words."""
        return self.name.lower().replace('_', ' ')


class GraspQuery(NamedTuple):
    """
    All that an analysis depends on.

    :ivar roller_positions: (r,) travel since home [m].
    :ivar body: the object, where it was measured.
    :ivar friction: coefficient between tube and object.
    :ivar external_wrench: (fx, fy, m) on the object about the origin of its frame [N, N m].
    :ivar spacing: of the contact points along the tubes [m].
    :ivar paper_model: see `analyze_grasp`.
    :ivar pressures: (t,) gauge pressures of the tubes, in the order of the robot file, which has
        them if None [Pa].
    """

    roller_positions: tuple[float, ...]
    body: ConvexObject
    friction: float
    external_wrench: tuple[float, float, float]
    spacing: float
    paper_model: bool = False
    pressures: tuple[float, ...] | None = None


@dataclass(frozen=True, eq=False)
class AnalyzedGrasp:
    """
    What went into an analysis, and what came out.

    :ivar config: configuration of the robot.
    :ivar body: the object.
    :ivar analysis: of the object held fast at the measured pose.
    :ivar settled: the equilibrium of the free object near to it.
    :ivar computing_time: of configuration and analysis [s].
    """

    config: Configuration
    body: ConvexObject
    analysis: GraspAnalysis
    settled: SettledGrasp
    computing_time: float

    @property
    def utilisation(self) -> dict[str, tuple[float, float]]:
        """
        Return how much of its wrinkling moment each member bears, friction included if it holds.

        :return: by member the larger one of the object held fast and, where it is at rest, the
            free one [-], and where that is, from its start [m].
        """
        grasps = (self.analysis, self.settled) if self.settled.hold.at_rest else (self.analysis,)
        return {
            name: max(
                (grasp.utilisation[name], grasp.utilisation_places[name]) for grasp in grasps
            )
            for name in self.analysis.utilisation
        }


@dataclass(frozen=True)
class GraspReport:
    """
    An answer, or none.

    :ivar code: OK if there is one, WRINKLED if it is outside of the model.
    :ivar message: why there is none, or what is special about the grasp; may be empty.
    :ivar time: for which the report holds, that of the older input; that of the call if there is
        none [s].
    :ivar grasp: the answer; None if there is none.
    """

    code: GraspCode
    message: str
    time: float
    grasp: AnalyzedGrasp | None = None

    @property
    def held(self) -> bool:
        """Return whether the object is known to be held, see `settle_grasp`; within the model."""
        return self.code is GraspCode.OK and self.grasp is not None and self.grasp.settled.held

    @property
    def force_closure(self) -> bool:
        """Return the force closure of the free object, see `SettledGrasp.force_closure`."""
        return self.grasp is not None and self.grasp.settled.force_closure
