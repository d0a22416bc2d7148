"""Messages received while a part of the demonstration ran."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from isotruss_msgs.msg import GraspState
from isotruss_ros.core import Pose, Status
from isotruss_ros.nodes.conversions.messages import read_stamp
import numpy as np


class Snapshot(NamedTuple):
    """The measured state at one time: roller travel [m] and the object's pose."""

    time: float
    rollers: np.ndarray
    pose: Pose


@dataclass
class PhaseRecord:
    """
    Result of one phase.

    :ivar name: of the phase.
    :ivar commanded: (dx, dy, dangle), the integral of the published twists [m, rad].
    :ivar measured: (dx, dy, dangle) of the measured pose; the angle unwrapped [m, rad].
    :ivar max_roller_speed: largest measured speed of any roller [m/s].
    :ivar loop_rate: cycles of the manipulation node per second [Hz].
    :ivar longest_cycle: longest time between two cycles of the manipulation node, or of the client
        that publishes the twists [s].
    :ivar statuses: all statuses of the manipulation node.
    :ivar snapshots: measured states, in time order.
    :ivar grasps: all results of the grasp analysis, in time order.
    """

    name: str
    commanded: np.ndarray = field(default_factory=lambda: np.zeros(3))
    measured: np.ndarray = field(default_factory=lambda: np.zeros(3))
    max_roller_speed: float = 0.0
    loop_rate: float = 0.0
    longest_cycle: float = 0.0
    statuses: set[Status] = field(default_factory=set)
    snapshots: list[Snapshot] = field(default_factory=list)
    grasps: list[GraspState] = field(default_factory=list)

    @property
    def position_error(self) -> float:
        """Return the distance of the measured from the commanded end [m]."""
        return float(np.linalg.norm((self.measured - self.commanded)[:2]))

    @property
    def angle_error(self) -> float:
        """Return the angle between the measured and the commanded end [rad]."""
        return abs(float((self.measured - self.commanded)[2]))

    def split(self, name: str, rollers: np.ndarray) -> tuple[PhaseRecord, PhaseRecord]:
        """
        Return the parts before and after the rollers came nearest to some positions.

        :param name: of the second part.
        :param rollers: (r,) [m].
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
        return before, after
