"""The demonstration's own node: sends twists, hears what becomes of them, all over DDS."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
import math
import time
from typing import NamedTuple

from geometry_msgs.msg import PoseStamped, Twist
from isotruss_msgs.msg import GraspState, ManipulationStatus
from isotruss_ros.core import IsotrussError, Pose, Status
from isotruss_ros.demo.path import Phase
from isotruss_ros.nodes.messages import RollerStates, seconds, twist_message
from isotruss_ros.nodes.qos import RELIABLE
import numpy as np
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

#: Twists are sent this often [s].
PERIOD = 0.01
#: What should come at once has this long on a busy machine [s].
DEADLINE = 20.0
#: The object rests when its pose has not changed for this long [s].
REST_TIME = 0.1


class DemoError(IsotrussError, RuntimeError):
    """The nodes did not do what they were asked."""


class Snapshot(NamedTuple):
    """The measured state at one time: roller travel [m] and the object's pose."""

    time: float
    rollers: np.ndarray
    pose: Pose


@dataclass
class PhaseRecord:
    """
    What came of one phase.

    :ivar commanded: (dx, dy, dangle), the integral of the twists that were sent [m, rad].
    :ivar measured: (dx, dy, dangle) of the measured pose; the angle unwrapped [m, rad].
    :ivar max_roller_speed: largest measured speed of any roller [m/s].
    :ivar loop_rate: cycles of the manipulation node per second [Hz].
    :ivar statuses: all that it reported while the phase ran.
    :ivar snapshots: measured states, in time order.
    :ivar grasps: all that the analysis of the grasp said, in time order.
    """

    name: str
    commanded: np.ndarray = field(default_factory=lambda: np.zeros(3))
    measured: np.ndarray = field(default_factory=lambda: np.zeros(3))
    max_roller_speed: float = 0.0
    loop_rate: float = 0.0
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


class DemoClient(Node):
    """
    Publishes `cmd_vel`; collects states, `manipulation/status` and `grasp/state`.

    :param roller_names: the robot's rollers in its order.
    """

    def __init__(self, roller_names: tuple[str, ...]) -> None:
        super().__init__('demo')
        self._twists = self.create_publisher(Twist, 'cmd_vel', RELIABLE)
        self._roller_states = RollerStates(roller_names)
        self._pose: Pose | None = None
        self._turned = 0.0
        self._moved = time.monotonic()
        self._rollers: np.ndarray | None = None
        self._last_status: ManipulationStatus | None = None
        self._status_times: list[float] = []
        self._record = PhaseRecord('start')
        every = QoSProfile(depth=100)
        self.create_subscription(PoseStamped, 'object_pose', self._take_pose, every)
        self.create_subscription(JointState, 'joint_states', self._take_joints, every)
        self.create_subscription(
            ManipulationStatus, 'manipulation/status', self._take_status, every
        )
        self.create_subscription(GraspState, 'grasp/state', self._take_grasp, every)
        self._own_executor = SingleThreadedExecutor()
        self._own_executor.add_node(self)

    def _take_pose(self, message: PoseStamped) -> None:
        q = message.pose.orientation
        angle = 2.0 * math.atan2(q.z, q.w)
        before = self._pose
        if before is not None:
            self._turned += math.remainder(angle - before.angle, 2.0 * math.pi)
        self._pose = Pose(message.pose.position.x, message.pose.position.y, angle)
        if self._pose != before:
            self._moved = time.monotonic()
        if self._rollers is not None:
            snapshot = Snapshot(seconds(message.header), self._rollers, self._pose)
            self._record.snapshots.append(snapshot)

    def _take_joints(self, message: JointState) -> None:
        self._rollers = self._roller_states.state(message).positions
        speed = max(map(abs, message.velocity), default=0.0)
        self._record.max_roller_speed = max(self._record.max_roller_speed, speed)

    def _take_status(self, message: ManipulationStatus) -> None:
        self._last_status = message
        self._record.statuses.add(Status(message.code))
        self._status_times.append(seconds(message.header))

    def _take_grasp(self, message: GraspState) -> None:
        self._record.grasps.append(message)

    def _spin_until(self, monotonic_time: float) -> None:
        while (left := monotonic_time - time.monotonic()) > 0.0:
            self._own_executor.spin_once(timeout_sec=left)

    def _hold_still(self, ready: Callable[[], bool], check: Callable[[], None], what: str) -> None:
        """Send zero twists until `ready`; `check` raises when it cannot come any more."""
        deadline = time.monotonic() + DEADLINE
        while not ready():
            if time.monotonic() > deadline:
                said = self._last_status.message if self._last_status else 'no status'
                raise DemoError(f'{what} did not happen within {DEADLINE} s; last heard: {said}')
            check()
            self._twists.publish(Twist())
            self._spin_until(time.monotonic() + PERIOD)

    def _resting(self) -> bool:
        idle = self._last_status is not None and self._last_status.code == Status.IDLE
        return idle and time.monotonic() - self._moved > REST_TIME

    def _grasp_known(self) -> bool:
        grasps = self._record.grasps
        return bool(grasps) and grasps[-1].code == GraspState.OK

    def wait_until_ready(self, check: Callable[[], None]) -> PhaseRecord:
        """
        Wait until all nodes talk and the object rests.

        :param check: raises when a node has gone.
        :return: what was heard meanwhile; ends with the state at rest.
        :raises DemoError: it did not come about in time.
        """
        self._hold_still(
            lambda: self._resting() and bool(self._record.snapshots), check, 'a robot at rest'
        )
        self._hold_still(self._grasp_known, check, 'an analysis of the grasp')
        return self._record

    def play(
        self, phase: Phase, check: Callable[[], None], progress: Callable[[float], None]
    ) -> PhaseRecord:
        """
        Send the twists of a phase, then wait until the object rests.

        :param check: raises when a node has gone.
        :param progress: told the share that is done.
        :raises DemoError: the object did not come to rest.
        """
        self._record = record = PhaseRecord(phase.name)
        self._status_times.clear()
        begin, turned = np.array(self._pose[:2]), self._turned
        start = now = time.monotonic()
        tick = 0
        while now - start < phase.duration:
            check()
            twist = phase.twist(now - start)
            self._twists.publish(twist_message(twist))
            tick += 1
            self._spin_until(start + tick * PERIOD)
            sent, now = now, time.monotonic()
            record.commanded += np.array(twist) * (now - sent)
            progress(min(1.0, (now - start) / phase.duration))
        times = self._status_times
        record.loop_rate = (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else 0.0
        self._moved = time.monotonic()
        self._hold_still(self._resting, check, f'rest after {phase.name!r}')
        record.measured[:2] = np.array(self._pose[:2]) - begin
        record.measured[2] = self._turned - turned
        return record
