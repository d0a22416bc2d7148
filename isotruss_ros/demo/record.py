# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Record of the messages received during a phase of the demonstration."""

from __future__ import annotations

from dataclasses import dataclass, field
import math
from typing import NamedTuple

from isotruss_msgs.msg import GraspState, StateEstimate
from isotruss_ros.core import Pose, Status
from isotruss_ros.nodes.conversions.messages import read_stamp
import numpy as np

#: Time without a contact force after which the object counts as lost [s]; on a busy machine,
#: messages are lost.
LOSS_TIME = 0.5


class Snapshot(NamedTuple):
    """Measured roller travel [m] and object pose at one time."""

    time: float
    rollers: np.ndarray
    pose: Pose


@dataclass
class PhaseRecord:
    """Record of the messages received during one phase."""

    name: str  #: name of the phase
    #: (dx, dy, dangle), integral of the twists that the manipulation node was to execute, by its
    #: statuses [m, rad]
    commanded: np.ndarray = field(default_factory=lambda: np.zeros(3))
    #: (dx, dy, dangle), integral of the same twists as executed, which limits may have reduced
    #: [m, rad]
    accepted: np.ndarray = field(default_factory=lambda: np.zeros(3))
    #: (dx, dy, dangle), change of the measured pose, with a continuous angle [m, rad]
    measured: np.ndarray = field(default_factory=lambda: np.zeros(3))
    #: largest commanded speed of the object; a rotation counts as its rate times 0.1 m [m/s]
    max_speed: float = 0.0
    #: external wrench (fx, fy, m) on the object [N, N m]; None without a wrench
    pull: tuple[float, float, float] | None = None
    #: interval of the external wrench, ROS time [s]
    pulled: tuple[float, float] = (math.inf, -math.inf)
    #: largest distance between the measured and the commanded position while the wrench acts [m]
    max_shift: float = 0.0
    max_roller_speed: float = 0.0  #: largest measured speed of any roller [m/s]
    loop_rate: float = 0.0  #: cycles of the manipulation node per second [Hz]
    #: lowest rate of its cycles in one second of the phase [Hz]
    lowest_rate: float = 0.0
    #: longest time between two cycles of the manipulation node or of the publishing client [s]
    longest_cycle: float = 0.0
    statuses: set[Status] = field(default_factory=set)  #: all statuses of the manipulation node
    #: measured states in the order of time
    snapshots: list[Snapshot] = field(default_factory=list)
    #: all results of the grasp analysis in the order of time
    grasps: list[GraspState] = field(default_factory=list)
    #: times of the true poses in their order [s], and true normal forces of the members [N] by
    #: their times [s], if received
    pose_times: list[float] = field(default_factory=list)
    forces: dict[float, list[float]] = field(default_factory=dict)
    #: true positions (j, 2) of the joints in the order of time [m], if received
    joints: list[np.ndarray] = field(default_factory=list)
    #: estimates of the state in the order of time, if the truth is recorded
    estimates: list[StateEstimate] = field(default_factory=list)

    @property
    def squeezes(self) -> list[float]:
        """Return the true mean normal force of the members at each true pose [N]; 0 if lost."""
        times = np.array(list(self.forces) or [math.inf])
        means = np.array([sum(each) / len(each) for each in self.forces.values()] or [0.0])
        distances = np.abs(np.subtract.outer(self.pose_times, times))
        nearest = distances.argmin(axis=1)
        is_lost = distances.min(axis=1) > LOSS_TIME
        return np.where(is_lost, 0.0, means[nearest]).tolist()

    @property
    def position_error(self) -> float:
        """Return the distance of the measured displacement from that by executed twists [m]."""
        return float(np.linalg.norm((self.measured - self.accepted)[:2]))

    @property
    def angle_error(self) -> float:
        """Return the difference of the measured rotation from that by executed twists [rad]."""
        return abs(float((self.measured - self.accepted)[2]))

    @property
    def shortfall(self) -> float:
        """Return the distance between the displacements by commanded and executed twists [m]."""
        return float(np.linalg.norm((self.accepted - self.commanded)[:2]))

    @property
    def delay(self) -> float:
        """Return the largest position error that late control cycles can cause [m]."""
        return 2.0 * self.max_speed * self.longest_cycle

    @property
    def analyses(self) -> list[GraspState]:
        """Return the grasp analyses of the phase that have a result."""
        return [grasp for grasp in self.grasps if grasp.code <= GraspState.WRINKLED]

    @property
    def held_fraction(self) -> float:
        """Return the fraction of grasp analyses with a held object; 0 without analyses."""
        held = [grasp.held == GraspState.HELD_YES for grasp in self.analyses]
        return float(np.mean(held)) if held else 0.0

    def parts(self) -> list[PhaseRecord]:
        """Return this record, and a record of the interval in which the external wrench acted."""
        if self.pull is None:
            return [self]
        begin, end = self.pulled
        within = [grasp for grasp in self.grasps if begin <= read_stamp(grasp.header) <= end]
        return [self, PhaseRecord(f'{self.name}, pulled', grasps=within)]

    def split(self, name: str, rollers: np.ndarray) -> tuple[PhaseRecord, PhaseRecord]:
        """
        Return the parts of the record before and after given roller positions were reached.

        :param rollers: (r,) roller positions [m].
        """
        distances = [
            float(np.abs(snapshot.rollers - rollers).max()) for snapshot in self.snapshots
        ]
        place = int(np.argmin(distances)) + 1
        time = self.snapshots[place - 1].time
        before, after = PhaseRecord(self.name), PhaseRecord(name)
        before.snapshots, after.snapshots = self.snapshots[:place], self.snapshots[place:]
        for grasp in self.grasps:
            (before if read_stamp(grasp.header) <= time else after).grasps.append(grasp)
        after.pose_times, after.forces = self.pose_times, self.forces
        after.joints, after.estimates = self.joints, self.estimates
        return before, after
