"""The demonstration's own node: sends twists, hears what becomes of them, all over DDS."""

from __future__ import annotations

from collections.abc import Callable
import math
import time

from geometry_msgs.msg import PoseStamped, Twist
from isotruss_msgs.msg import GraspState, ManipulationStatus
from isotruss_ros.core import IsotrussError, Pose, Status
from isotruss_ros.demo.path import Phase
from isotruss_ros.demo.record import PhaseRecord, Snapshot
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


class DemoClient(Node):
    """
    Publishes `cmd_vel`; collects states, `manipulation/status` and `grasp/state`.

    :ivar frame_id: of the object's pose.
    :param roller_names: the robot's rollers in its order.
    """

    def __init__(self, roller_names: tuple[str, ...]) -> None:
        super().__init__('demo')
        self._twists = self.create_publisher(Twist, 'cmd_vel', RELIABLE)
        self._roller_states = RollerStates(roller_names)
        self.frame_id = ''
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

    @property
    def pose(self) -> Pose:
        """Return the pose of the object that was measured last."""
        return self._pose

    @property
    def rollers(self) -> np.ndarray:
        """Return the roller positions that were measured last (r,) [m]."""
        return self._rollers

    def _take_pose(self, message: PoseStamped) -> None:
        self.frame_id = message.header.frame_id
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
        rollers = self._roller_states.state(message).positions
        if self._rollers is None or not np.array_equal(rollers, self._rollers):
            self._moved = time.monotonic()
        self._rollers = rollers
        speed = max(map(abs, message.velocity), default=0.0)
        self._record.max_roller_speed = max(self._record.max_roller_speed, speed)

    def _take_status(self, message: ManipulationStatus) -> None:
        self._last_status = message
        self._record.statuses.add(Status(message.code))
        self._status_times.append(seconds(message.header))

    def _take_grasp(self, message: GraspState) -> None:
        self._record.grasps.append(message)

    def begin(self, name: str) -> PhaseRecord:
        """Begin a phase: what is heard from now on belongs to its record."""
        self._record = PhaseRecord(name)
        self._status_times.clear()
        return self._record

    def wait(
        self,
        ready: Callable[[], bool],
        check: Callable[[], None],
        what: str,
        deadline: float = DEADLINE,
        meanwhile: Callable[[], None] | None = None,
    ) -> None:
        """
        Wait for something.

        :param check: raises when it cannot come any more.
        :param what: it is, for the error.
        :param deadline: within which it must come [s].
        :param meanwhile: called every `PERIOD`.
        :raises DemoError: it did not come in time.
        """
        end = time.monotonic() + deadline
        while not ready():
            if time.monotonic() > end:
                said = self._last_status.message if self._last_status else 'no status'
                raise DemoError(f'{what} did not happen within {deadline} s; last heard: {said}')
            check()
            if meanwhile is not None:
                meanwhile()
            self._spin_until(time.monotonic() + PERIOD)

    def _spin_until(self, monotonic_time: float) -> None:
        while (left := monotonic_time - time.monotonic()) > 0.0:
            self._own_executor.spin_once(timeout_sec=left)

    def resting(self) -> bool:
        """Tell whether the object and the rollers have not moved for a while."""
        return self._rollers is not None and time.monotonic() - self._moved > REST_TIME

    def _idle(self) -> bool:
        idle = self._last_status is not None and self._last_status.code == Status.IDLE
        return idle and self.resting()

    def last_grasp(self) -> GraspState | None:
        """Return what the analysis said last in this phase."""
        return self._record.grasps[-1] if self._record.grasps else None

    def wait_until_obeyed(self, check: Callable[[], None]) -> None:
        """
        Wait until the manipulation answers twists, and the object rests.

        :param check: raises when a node has gone.
        :raises DemoError: it did not come about in time.
        """
        self._hold_still(check, 'a manipulation that is ready')

    def play(
        self, phase: Phase, check: Callable[[], None], progress: Callable[[float], None]
    ) -> PhaseRecord:
        """
        Send the twists of a phase, then wait until the object rests.

        :param check: raises when a node has gone.
        :param progress: told the share that is done.
        :raises DemoError: the object did not come to rest.
        """
        record = self.begin(phase.name)
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
        self._hold_still(check, f'rest after {phase.name!r}')
        record.measured[:2] = np.array(self._pose[:2]) - begin
        record.measured[2] = self._turned - turned
        return record

    def _hold_still(self, check: Callable[[], None], what: str) -> None:
        """Send zero twists until the object rests."""
        self.wait(self._idle, check, what, meanwhile=lambda: self._twists.publish(Twist()))
