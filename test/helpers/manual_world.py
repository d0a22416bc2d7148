# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes whose callbacks and timers the test calls, by a clock of its own: no executor, no DDS."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
import contextlib
import itertools
import math
import time
from types import SimpleNamespace
from typing import Any
import uuid
from weakref import WeakKeyDictionary

from action_msgs.msg import GoalInfo
from geometry_msgs.msg import Twist
from isotruss_ros.core import IsotrussError, load_robot, Robot, Status
from isotruss_ros.nodes.framework import managed
from isotruss_ros.nodes.framework.managed import ManagedNode
from probe import Manager, manipulation, Probe, Watched
import pytest
import rclpy
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import GoalEvent, ServerGoalHandle
from rclpy.clock import Clock, ClockType, ROSClock
from rclpy.event_handler import QoSSubscriptionEventType
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.subscription import Subscription
from rclpy.time import Time
from rclpy.timer import Timer
from robots import preset, PRESETS

#: In which everything here comes about [s of the test's clock].
DEADLINE = 20.0
#: The system's clock at the beginning [s].
EPOCH = 1.7e9
UP, DOWN = Manager.UP, Manager.DOWN
TRANSIENT, BEST_EFFORT = DurabilityPolicy.TRANSIENT_LOCAL, ReliabilityPolicy.BEST_EFFORT


def match(offered: QoSProfile, requested: QoSProfile) -> bool:
    durable = offered.durability == TRANSIENT or requested.durability != TRANSIENT
    reliable = offered.reliability != BEST_EFFORT or requested.reliability == BEST_EFFORT
    return durable and reliable


def call_back(subscription: Subscription, message: Any, number: int) -> None:
    """Hand a message over in the form in which the subscription takes it, with its number."""
    arguments = [serialize_message(message) if subscription.raw else message]
    if subscription._callback_type is Subscription.CallbackType.WithMessageInfo:
        arguments.append({'publication_sequence_number': number})
    subscription.callback(*arguments)


def call_at_once(_pool: ThreadPoolExecutor, call: Callable[..., Any], *arguments: Any) -> Future:
    """Stand in for `submit`: no thread, whose time is not the test's."""
    done: Future = Future()
    try:
        done.set_result(call(*arguments))
    except Exception as error:  # noqa: BLE001 - kept for `result`, as a pool does
        done.set_exception(error)
    return done


def read_once(name: str) -> Robot:
    """Stand in for `load_robot`: a preset is read once, other files each time."""
    return preset(name) if name in PRESETS else load_robot(name)


class Goal:
    """A goal of an action, as its client has it; `feedback` is empty where `note` receives it."""

    def __init__(
        self,
        server: ActionServer,
        request: Any,
        goal_id: list[int] | None = None,
        note: Callable[[Any], None] | None = None,
    ) -> None:
        self._server = server
        self.feedback: list[Any] = []
        self._course: Any = None
        self.accepted = server._goal_callback(request) is GoalResponse.ACCEPT
        if not self.accepted:
            return
        info = self.info = GoalInfo()
        info.goal_id.uuid = goal_id or list(uuid.uuid4().bytes)
        self._handle = ServerGoalHandle(server, info, request)
        self._handle.publish_feedback = note or self.feedback.append
        self._handle.execute = self._execute
        self._result = rclpy.task.Future()
        server._result_futures[bytes(info.goal_id.uuid)] = self._result
        server.add_future(self._result)
        server._handle_accepted_callback(self._handle)

    def _execute(self) -> None:
        self._handle._update_state(GoalEvent.EXECUTE)
        self._course = self._server._execute_goal(self._server._execute_callback, self._handle)

    def advance(self) -> None:
        """Resume the server's coroutine, as an executor does in every turn."""
        if self._course is not None:
            try:
                self._course.send(None)
            except StopIteration:
                self._course = None

    def cancel(self) -> bool:
        """Ask for the end; return whether the server agrees."""
        if not self._handle.is_active:
            return False
        agreed = self._server._cancel_callback(self._handle) is CancelResponse.ACCEPT
        if agreed:
            self._handle._update_state(GoalEvent.CANCEL_GOAL)
        return agreed

    @property
    def ended(self) -> bool:
        return self.accepted and self._result.done()

    def result(self) -> tuple[int, Any]:
        response = self._result.result()
        return response.status, response.result


class World(Watched):
    """Nodes and a probe, driven by hand, with clocks [s] and the time of callbacks `busy` [s]."""

    def __init__(self, remaps: dict[tuple[str, str], str]) -> None:
        self.now = self.shift = 0.0
        self.busy: Callable[[], float] = lambda: 0.0
        self.nodes: list[Node] = []
        self._remaps = remaps
        self._queue: deque[tuple[str, Any, QoSProfile, int]] = deque()
        self._latched: dict[tuple[Publisher, str], deque[tuple[str, Any, QoSProfile, int]]] = {}
        self._numbers: WeakKeyDictionary[Publisher, Iterator[int]] = WeakKeyDictionary()
        self._served: set[Subscription] = set()
        self._present: list[Subscription] = []
        self._receivers: dict[tuple[Any, ...], list[Subscription]] = {}
        self._due: dict[Timer, float] = {}
        self._goals: list[Goal] = []
        self._topics = WeakKeyDictionary[Publisher | Subscription, str]()

    def begin(
        self, makers: Sequence[Callable[[], Node]], twist_type: type, sim_time: bool
    ) -> None:
        self.probe = Probe(twist_type, sim_time)
        self.nodes.append(self.probe)
        for make in makers:
            self.add(make())

    def add(self, node: Node) -> Node:
        self.nodes.append(node)
        return node

    # -- What stands in for rclpy --

    def read(self, clock: Clock) -> Time:
        if isinstance(clock, ROSClock) and clock.ros_time_is_active:
            return READ_CLOCK(clock)
        steady = clock.clock_type == ClockType.STEADY_TIME
        seconds = self.now if steady else EPOCH + self.now + self.shift
        return Time(nanoseconds=round(1e9 * seconds), clock_type=clock.clock_type)

    def publish(self, publisher: Publisher, message: Any) -> None:
        """Take a publication; it is delivered in the next turn."""
        if not isinstance(message, publisher.msg_type | bytes):
            raise TypeError(f'{message!r} is no {publisher.msg_type}')
        topic, offered = self._resolve(publisher), publisher.qos_profile
        is_latched = offered.durability == TRANSIENT
        if not is_latched and not self._subscribers(topic, publisher.msg_type, offered):
            return
        data = message if isinstance(message, bytes) else serialize_message(message)
        copied = deserialize_message(data, publisher.msg_type)
        number = next(self._numbers.setdefault(publisher, itertools.count(1)))
        sent = (topic, copied, offered, number)
        self._queue.append(sent)
        if is_latched:
            kept = self._latched.setdefault((publisher, topic), deque(maxlen=offered.depth))
            kept.append(sent)

    def count_subscriptions(self, publisher: Publisher) -> int:
        topic = self._resolve(publisher)
        return len(self._subscribers(topic, publisher.msg_type, publisher.qos_profile))

    def _resolve(self, entity: Publisher | Subscription) -> str:
        if entity not in self._topics:
            topic = entity.topic_name
            for node in self.nodes:
                if entity in (*node.publishers, *node.subscriptions):
                    self._topics[entity] = self._remaps.get((node.get_name(), topic), topic)
            # Not kept while its node is still being made.
            return self._topics.get(entity, topic)
        return self._topics[entity]

    # -- One turn --

    def turn(self, until: float = math.inf) -> None:
        """Go to the next timer that is due, call it, and deliver what it published."""
        timers = [timer for node in self.nodes for timer in node.timers]
        self._due = {timer: self._due[timer] for timer in timers if timer in self._due}
        waits = []
        for timer in timers:
            now, period = 1e-9 * timer.clock.now().nanoseconds, 1e-9 * timer.timer_period_ns
            due = min(self._due.get(timer, now + period), now + period)
            self._due[timer] = due
            simulated = isinstance(timer.clock, ROSClock) and timer.clock.ros_time_is_active
            waits.append(due - now if not simulated or due <= now else math.inf)
        wait = max(0.0, min(waits, default=math.inf))
        if self.now + wait > until:
            self.now = max(self.now, until)
        else:
            self.now += wait
            timer = timers[waits.index(min(waits))]
            # As rcl does it: periods that have passed already are left out.
            now, period = 1e-9 * timer.clock.now().nanoseconds, 1e-9 * timer.timer_period_ns
            late = max(0.0, now - self._due[timer])
            self._due[timer] += (1 + math.floor(late / period)) * period
            timer.callback()
            self.now += self.busy()
        self.deliver()

    def deliver(self) -> None:
        """Deliver all that was published, and resume the goals."""
        while True:
            self._serve_late_joiners()
            if not self._queue:
                break
            topic, message, offered, number = self._queue.popleft()
            for subscription in self._subscribers(topic, type(message), offered):
                call_back(subscription, message, number)
        for goal in self._goals:
            goal.advance()

    def _subscribers(self, topic: str, kind: type, offered: QoSProfile) -> list[Subscription]:
        present = [subscription for node in self.nodes for subscription in node.subscriptions]
        if present != self._present:
            self._present = present
            self._receivers.clear()
        key = topic, kind, offered.durability, offered.reliability
        if key not in self._receivers:
            self._receivers[key] = [
                subscription
                for subscription in present
                if self._resolve(subscription) == topic
                and subscription.msg_type is kind
                and match(offered, subscription.qos_profile)
            ]
        return self._receivers[key]

    def _serve_late_joiners(self) -> None:
        """Deliver what was latched before a subscription was made."""
        for node in self.nodes:
            for subscription in node.subscriptions:
                if subscription in self._served:
                    continue
                self._served.add(subscription)
                if subscription.qos_profile.durability != TRANSIENT:
                    continue
                waiting = {id(message) for _, message, *_ in self._queue}
                first = -subscription.qos_profile.depth
                for kept in self._latched.values():
                    for topic, message, _, number in [*kept][first:]:
                        if topic == subscription.topic_name and id(message) not in waiting:
                            call_back(subscription, message, number)

    # -- What tests ask for --

    def until(
        self, ok: Callable[[], bool], each: Callable[[], None] = lambda: None, period: float = 0.01
    ) -> None:
        """Let time go on until something holds; fail at the deadline."""
        deadline = self.now + DEADLINE
        due = self.now
        while True:
            if self.now >= due:
                if ok():
                    return
                each()
                self.deliver()
                due += period
            elif ok():
                return
            assert self.now < deadline, f'not within {DEADLINE} s'
            self.turn(due)

    def call(self, name: str, request: Any) -> Any:
        """Return the response of a service, named relative to the root."""
        for node in self.nodes:
            for service in node.services:
                if service.service_name == f'/{name}':
                    response = service.callback(request, service.srv_type.Response())
                    self.deliver()
                    return response
        raise AssertionError(f'no service {name}')

    def find_servers(self, kind: type) -> list[ActionServer]:
        """Return the servers of an action, given by the type of its goals."""
        return [
            waitable
            for node in self.nodes
            for waitable in node.waitables
            if isinstance(waitable, ActionServer) and waitable._action_type.Goal is kind
        ]

    def send_goal(self, request: Any) -> Goal:
        """Send a goal to the only server of its action."""
        goal = self.begin_goal(request)
        self.deliver()
        return goal

    def finish(self, goal: Goal, each: Callable[[], None] = lambda: None) -> tuple[int, Any]:
        """Let time go on until a goal has ended; return its status and result."""
        self.until(lambda: goal.ended, each)
        return goal.result()

    def begin_goal(self, request: Any, *arguments: Any) -> Goal:
        """Send a goal, with arguments of `Goal`, within a turn."""
        (server,) = self.find_servers(type(request))
        self._goals.append(Goal(server, request, *arguments))
        return self._goals[-1]


READ_CLOCK = Clock.now


def _keep_participant() -> None:
    """Keep the participant: Fast DDS 2.14 may hang if one is destroyed during discovery."""
    kept = rclpy.create_node('kept', start_parameter_services=False)
    # A method would be held weakly, and the node with it.
    rclpy.get_default_context().on_shutdown(lambda: kept.destroy_node())


@contextlib.contextmanager
def world(
    *makers: Callable[[], ManagedNode],
    twist_type: type = Twist,
    sim_time: bool = False,
    remaps: dict[tuple[str, str], str] | None = None,
    enter: Callable[[World], None] = lambda w: None,
) -> Iterator[World]:
    """Bring up nodes and a probe, once `enter` has the world, and destroy them at the end."""
    if not rclpy.ok():
        # A service of this kind outlives its node, and each slows all that follows.
        rclpy.init(args=['--ros-args', '-p', 'start_type_description_service:=false'])
        _keep_participant()
    w = World(remaps or {})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Clock, 'now', lambda clock: w.read(clock))
        patch.setattr(time, 'monotonic', lambda: w.now)
        patch.setattr(ThreadPoolExecutor, 'submit', call_at_once)
        patch.setattr(Publisher, 'publish', lambda pub, message: w.publish(pub, message))
        patch.setattr(Publisher, 'get_subscription_count', lambda pub: w.count_subscriptions(pub))
        patch.setattr(managed, 'load_robot', read_once)
        try:
            enter(w)
            w.begin(makers, twist_type, sim_time)
            w.deliver()
            yield w
        finally:
            for node in w.nodes:
                for waitable in list(node.waitables):
                    waitable.destroy()
                node.destroy_node()
                if hasattr(node, '_state_machine'):
                    # Or rclpy keeps the lifecycle services until the garbage is collected.
                    node._state_machine.destroy_when_not_in_use()


@contextlib.contextmanager
def moving_world(**values: object) -> Iterator[World]:
    """Make manipulation with parameters, and let it move the object."""
    with world(manipulation(**values)) as w:
        w.until_code(Status.OK, w.probe.send_all)
        yield w


def report_matches(node: Node, topic: str, *events: tuple[int, int]) -> None:
    """Call a node back with how many publishers of a topic came, and how many left."""
    (handler,) = (
        handler
        for subscription in node.subscriptions
        if subscription.topic_name == f'/{topic}'
        for handler in subscription.event_handlers
        if handler.event_type == QoSSubscriptionEventType.RCL_SUBSCRIPTION_MATCHED
    )
    for came, left in events:
        change = {'total_count_change': came, 'current_count_change': came - left}
        handler.callback(SimpleNamespace(**change))


def check_refused(make_node: Callable[[], ManagedNode], words: str) -> None:
    """Check that a node does not start, and names the reason."""
    with world(), pytest.raises(IsotrussError, match=words):
        make_node()
