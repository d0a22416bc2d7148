# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node of the demonstration, which publishes twists and records messages of the other nodes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
import math
import os
import time

from geometry_msgs.msg import PoseStamped, Twist, WrenchStamped
from isotruss_msgs.msg import GraspState, ManipulationStatus, StateEstimate
from isotruss_ros.core import IsotrussError, Pose, Status
from isotruss_ros.core.manipulation.status import GRIP_FAULTS
from isotruss_ros.demo.path import Phase, Wrench
from isotruss_ros.demo.record import PhaseRecord, Snapshot
from isotruss_ros.nodes.conversions.grasp_messages import to_wrench_message
from isotruss_ros.nodes.conversions.messages import (
    ALIGNED_OBJECT,
    make_header,
    name_frame,
    read_pose,
    read_stamp,
    to_twist_message,
)
from isotruss_ros.nodes.conversions.sensor_messages import read_roller_part
from isotruss_ros.nodes.framework.cycle import RATE_PERIOD
from isotruss_ros.nodes.framework.topics import RELIABLE
import numpy as np
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState, MultiDOFJointState

#: Period of the twists [s].
PERIOD = 0.01
#: Longest wait for a message [s]. It is constant, because rclpy's executor begins again with the
#: first subscription whenever the timeout changes, and a busy first subscription would then block
#: the others.
MAX_SPIN_TIME = 2e-3
#: Longest wait for events that occur at once unless the machine is busy [s].
DEADLINE = 240.0
#: Object and rollers count as at rest if they move by less than this distance [m, rad] within this
#: time by the messages' stamps [s].
REST_DISTANCE, REST_TIME = 2e-6, 0.1
#: Value in place of `REST_DISTANCE` for a plant in which friction creeps and objects oscillate [m,
#: rad].
OSCILLATING_REST_DISTANCE = 1e-4
#: Value in place of `REST_DISTANCE` with sensor noise, which the control loop follows [m, rad].
NOISY_REST_DISTANCE = 5e-3
#: Lever arm that converts rotations of the object to distances [m].
LEVER_ARM = 0.1
#: Halts of the manipulation node that end the demonstration after this duration by the stamps of
#: the status [s].
FINAL_HALTS = {
    Status.HALT_TRAJECTORY: 0.0,
    Status.HALT_EMERGENCY_STOP: 0.0,
    Status.HALT_OTHER_COMMANDS: 5.0,
    **{code: fault.patience for code, fault in GRIP_FAULTS.items()},
}
#: Number of queued statuses, those of 10 s at 100 Hz; a lost one falsifies the sums of twists [-].
STATUS_DEPTH = 1000
#: Topics that have a single publisher unless two robots share a ROS domain.
SINGLE_PUBLISHER_TOPICS = ('joint_states', 'object_pose')


def measure_rates(times: Sequence[float]) -> tuple[float, float]:
    """
    Return the mean rate of events, and the lowest rate in an interval of `RATE_PERIOD` [Hz].

    :param times: increasing times of the events [s].
    """
    if len(times) < 2:
        return 0.0, 0.0
    mean = (len(times) - 1) / (times[-1] - times[0])
    begins = np.array(times)
    begins = begins[begins <= times[-1] - RATE_PERIOD]
    counts = np.searchsorted(times, begins + RATE_PERIOD) - np.arange(len(begins))
    return mean, float(counts.min(initial=mean * RATE_PERIOD)) / RATE_PERIOD


class DemoError(IsotrussError, RuntimeError):
    """Error: the nodes did not execute a request."""


class DemoClient(Node):
    """
    Node that publishes twists, and records states, status messages and grasp analyses.

    :ivar frame_id: frame of the object's pose.
    :ivar measured: last measured pose of the object.
    :ivar pose: last recorded pose of the object.
    :ivar rollers: (r,) last roller positions, including the estimated offsets if available [m].
    :param truth: True to record the true states of robot and object in place of measured states,
        and in addition the state estimates.
    """

    def __init__(
        self, roller_names: tuple[str, ...], sim_time: bool = False, truth: bool = False
    ) -> None:
        super().__init__('demo', parameter_overrides=[Parameter('use_sim_time', value=sim_time)])
        self._sim_time = sim_time
        self._rest_distance = OSCILLATING_REST_DISTANCE if sim_time else REST_DISTANCE
        if truth:
            self._rest_distance = NOISY_REST_DISTANCE
        self._twists = self.create_publisher(Twist, 'cmd_vel', RELIABLE)
        self._wrenches = self.create_publisher(WrenchStamped, 'external_wrench', RELIABLE)
        self._pulls = False
        self._roller_names = roller_names
        self.frame_id = ''
        self.measured: Pose | None = None
        self.pose: Pose | None = None
        self._turned = 0.0
        self._stamp = self._moved = self._ended = -math.inf
        self._rest: np.ndarray | None = None
        self.rollers: np.ndarray | None = None
        self._offsets = np.zeros(len(roller_names))
        self._last_status: ManipulationStatus | None = None
        self._began = 0.0  # time at which the last status code began [s]
        self._status_times: list[float] = []
        self._record = PhaseRecord('start')
        self._truth = truth
        every = QoSProfile(depth=100)
        self.create_subscription(PoseStamped, 'object_pose', self._take_measured, every)
        self._pose_topic = 'truth/object_pose' if truth else 'object_pose'
        self.create_subscription(PoseStamped, self._pose_topic, self._take_pose, every)
        if truth:
            for kind, topic, take in (
                (WrenchStamped, 'truth/contact_forces', self._take_forces),
                (MultiDOFJointState, 'truth/joint_markers', self._take_places),
                (StateEstimate, 'state_estimate', self._take_estimate),
            ):
                self.create_subscription(kind, topic, take, every)
        self.create_subscription(JointState, 'joint_states', self._take_joints, every)
        statuses = QoSProfile(depth=STATUS_DEPTH)
        self.create_subscription(
            ManipulationStatus, 'manipulation/status', self._take_status, statuses
        )
        self.create_subscription(GraspState, 'grasp/state', self._take_grasp, every)
        self._own_executor = SingleThreadedExecutor()
        self._own_executor.add_node(self)

    def _take_measured(self, message: PoseStamped) -> None:
        self.frame_id = message.header.frame_id
        self.measured = read_pose('object pose', message.pose)

    def _take_forces(self, message: WrenchStamped) -> None:
        forces = self._record.forces.setdefault(read_stamp(message.header), [])
        forces.append(message.wrench.force.x)

    def _take_places(self, message: MultiDOFJointState) -> None:
        places = [(each.translation.x, each.translation.y) for each in message.transforms]
        self._record.joints.append(np.array(places))

    def _take_estimate(self, message: StateEstimate) -> None:
        self._record.estimates.append(message)
        self._offsets = np.array(message.offsets)

    def _take_pose(self, message: PoseStamped) -> None:
        before, self.pose = self.pose, read_pose('object pose', message.pose)
        if before is not None:
            self._turned += math.remainder(self.pose.angle - before.angle, 2.0 * math.pi)
        self._stamp = read_stamp(message.header)
        if self._truth:
            self._record.pose_times.append(self._stamp)
        if self.rollers is not None:
            self._record.snapshots.append(Snapshot(self._stamp, self.rollers, self.pose))
            here = np.concatenate([self.pose, self.rollers])
            if self._rest is None or np.abs(here - self._rest).max() > self._rest_distance:
                self._rest, self._moved = here, self._stamp

    def _take_joints(self, message: JointState) -> None:
        read = read_roller_part(message, self._roller_names)
        self.rollers = np.array([read[i][0] for i in range(len(read))]) + self._offsets
        speed = max(map(abs, message.velocity), default=0.0)
        self._record.max_roller_speed = max(self._record.max_roller_speed, speed)

    def _take_status(self, message: ManipulationStatus) -> None:
        last, self._last_status = self._last_status, message
        if last is not None:
            held = read_stamp(message.header) - read_stamp(last.header)
            v, turn = last.commanded.linear, last.commanded.angular.z
            moved = held * np.array([v.x, v.y, turn])
            self._record.commanded += moved
            self._record.accepted += last.scale * moved
        self._record.statuses.add(Status(message.code))
        self._status_times.append(read_stamp(message.header))
        if last is None or message.code != last.code:
            self._began = read_stamp(message.header)

    def _take_grasp(self, message: GraspState) -> None:
        self._record.grasps.append(message)

    def destroy_node(self) -> None:
        """Shut down the executor and destroy the node."""
        self._own_executor.shutdown()
        super().destroy_node()

    def begin(self, name: str) -> PhaseRecord:
        """Start a phase of the demonstration, in whose record messages are stored from now on."""
        self._record = PhaseRecord(name)
        self._status_times.clear()
        return self._record

    def wait(
        self,
        find_unmet: Callable[[], Iterable[str]],
        check: Callable[[], None],
        what: str,
        deadline: float = DEADLINE,
        meanwhile: Callable[[], None] | None = None,
        of_manipulation: bool = True,
    ) -> None:
        """
        Wait until all conditions are met, while messages are received.

        :param find_unmet: function that returns a sentence for each unmet condition, with value
            and bound.
        :param of_manipulation: whether the manipulation node has to meet them; an error then has
            its last status.
        """
        before, changed = self._seconds(), time.monotonic()
        end = before + deadline
        while unmet := list(find_unmet()):
            now = self._seconds()
            if now != before:
                before, changed = now, time.monotonic()
            # A slow clock is normal on a busy machine; a clock that stands still is a fault.
            stopped = time.monotonic() - changed
            if now > end or stopped > DEADLINE:
                clock = f'/clock has stood still for {stopped:.0f} s; ' if now <= end else ''
                if of_manipulation:
                    last = self._last_status.message if self._last_status else 'none'
                    unmet.append(f'last status of manipulation: {last or "without a message"}')
                raise DemoError(
                    f'{what}: not reached in {deadline:g} s: {clock}{"; ".join(unmet)}'
                )
            check()
            self._require_motion()
            if meanwhile is not None:
                meanwhile()
            until = time.monotonic() + PERIOD
            while time.monotonic() < until:
                self._own_executor.spin_once(timeout_sec=MAX_SPIN_TIME)

    def _require_motion(self) -> None:
        """Raise DemoError if the manipulation node has halted and does not resume by itself."""
        last = self._last_status
        most = math.inf if last is None else FINAL_HALTS.get(Status(last.code), math.inf)
        if most < math.inf and read_stamp(last.header) - self._began >= most:
            raise DemoError(f'manipulation: {Status(last.code)}: {last.message}')

    def _seconds(self) -> float:
        """Return the time of `/clock` in simulated time, otherwise of the machine's clock [s]."""
        if self._sim_time:
            return 1e-9 * self.get_clock().now().nanoseconds
        return time.monotonic()

    def find_no_analysis(self) -> Iterable[str]:
        """Yield a sentence unless the last analysis of the grasp has no fault."""
        grasp = self.last_grasp()
        if grasp is None:
            yield 'no analysis of the grasp has been received'
        elif grasp.code != GraspState.OK:
            yield f'the last analysis of the grasp has the code {grasp.code}: {grasp.message}'

    def find_motion(self) -> Iterable[str]:
        """Yield a sentence unless object and rollers have been at rest for `REST_TIME`."""
        if self._rest is None:
            topics = {'joint_states': self.rollers, self._pose_topic: self.pose}
            missing = [name for name, value in topics.items() if value is None]
            yield f'no message of {" and ".join(missing or topics)}'
        elif self._stamp - self._moved <= REST_TIME:
            yield (
                f'object and rollers have moved by less than {self._rest_distance:g} m or rad for '
                f'only {self._stamp - self._moved:.3g} s; must be {REST_TIME:g} s'
            )

    def _find_activity(self) -> Iterable[str]:
        """Yield sentences unless the manipulation node executes a zero twist at rest."""
        last = self._last_status
        if last is None or read_stamp(last.header) <= self._ended:
            yield 'no new status of manipulation'
        elif last.code not in (Status.OK, Status.IDLE):
            yield f'the status is {Status(last.code)}; must be OK or IDLE'
        elif last.commanded != Twist():
            yield 'manipulation executes a twist; must be zero'
        yield from self.find_motion()

    def require_alone(self) -> None:
        """Raise DemoError if there is another robot in this ROS domain."""
        for topic in SINGLE_PUBLISHER_TOPICS:
            if (count := self.count_publishers(topic)) > 1:
                raise DemoError(
                    f'{count} nodes publish {topic} in ROS domain {os.environ["ROS_DOMAIN_ID"]}: '
                    'another robot or simulation is there; end it, or set ROS_DOMAIN_ID to '
                    'another domain'
                )

    def last_grasp(self) -> GraspState | None:
        """Return the last result of the grasp analysis in this phase."""
        return self._record.grasps[-1] if self._record.grasps else None

    def play(
        self, phase: Phase, check: Callable[[], None], progress: Callable[[float], None]
    ) -> PhaseRecord:
        """Publish the twists of a phase, then wait until the object is at rest."""
        record = self.begin(phase.name)
        begin, turned = np.array(self.pose[:2]), self._turned
        start = now = self._seconds()
        tick = 0
        while now - start < phase.duration:
            check()
            self._require_motion()
            twist = phase.twist(now - start)
            self._twists.publish(to_twist_message(twist))
            self._pull(phase.wrench(now - start))
            record.max_speed = max(
                record.max_speed, math.hypot(twist[0], twist[1]) + LEVER_ARM * abs(twist[2])
            )
            tick += 1
            while self._seconds() < start + tick * PERIOD:
                self._own_executor.spin_once(timeout_sec=MAX_SPIN_TIME)
            sent, now = now, self._seconds()
            record.longest_cycle = max(record.longest_cycle, now - sent)
            if record.pull is not None:
                away = np.array(self.pose[:2]) - begin - record.accepted[:2]
                record.max_shift = max(record.max_shift, float(np.hypot(*away)))
            progress(min(1.0, (now - start) / phase.duration))
        times = self._status_times
        record.loop_rate, record.lowest_rate = measure_rates(times)
        self.wait_for_rest(check, f'rest after {phase.name!r}')
        gaps = (after - before for before, after in pairwise(times))
        record.longest_cycle = max((record.longest_cycle, *gaps))
        record.measured[:2] = np.array(self.pose[:2]) - begin
        record.measured[2] = self._turned - turned
        return record

    def _pull(self, wrench: Wrench) -> None:
        """Publish an external wrench on the object, and record the interval in which it acts."""
        now, pulls, record = self.get_clock().now(), any(wrench), self._record
        self._pulls = self._pulls or pulls
        if not self._pulls:
            return  # where nothing ever pulled, nothing has to end
        seconds = 1e-9 * now.nanoseconds
        if pulls:
            record.pull, record.pulled = wrench, (min(record.pulled[0], seconds), seconds)
        message = WrenchStamped(wrench=to_wrench_message(wrench))
        message.header = make_header(seconds, name_frame(self.frame_id, ALIGNED_OBJECT))
        self._wrenches.publish(message)

    def wait_for_rest(self, check: Callable[[], None], what: str) -> None:
        """Publish zero twists until the manipulation node executes them and the object rests."""
        self._ended = self._stamp

        def stand() -> None:
            self._twists.publish(Twist())
            self._pull((0.0, 0.0, 0.0))

        self.wait(self._find_activity, check, what, meanwhile=stand)
