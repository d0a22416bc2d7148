# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Base class of managed (lifecycle) nodes; they activate themselves if `autostart` is set."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
import inspect
import traceback
from typing import Any, ClassVar

from diagnostic_msgs.msg import DiagnosticStatus
from isotruss_ros.core import IsotrussError, load_robot, Robot
from isotruss_ros.nodes.framework.diagnostics import Diagnostics
from isotruss_ros.nodes.framework.parameters import (
    AUTOSTART,
    ParameterError,
    ROBOT,
    UNCONFIGURED_ONLY,
    Value,
)
from isotruss_ros.nodes.framework.runner import StoppableNode
from rcl_interfaces.msg import SetParametersResult
from rclpy.action import ActionClient, ActionServer
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter

SUCCESS = TransitionCallbackReturn.SUCCESS
FAILURE = TransitionCallbackReturn.FAILURE
ERROR = TransitionCallbackReturn.ERROR


class ManagedNode(StoppableNode, LifecycleNode):
    """
    Base class of managed nodes; subclasses override the steps of the life cycle.

    Entities (publishers, subscriptions, services, action servers, timers) that `configure` creates
    are destroyed at cleanup; entities that `activate` creates are destroyed at deactivation. A
    publisher that must be silent while the node is inactive is created by `advertise`.

    If a step raises an `IsotrussError`, the node keeps its previous state; after any other
    exception the node is unconfigured. The reason is in the log and in the diagnostics.

    :cvar awaited: topics and actions that the active node needs, mentioned in the log.
    :cvar idle: text of the diagnostics while the active node has no goal.
    :ivar inputs: `Inputs` created by `configure`, whose ages the diagnostics report; None if the
        node has no inputs.
    :ivar configured: whether `configure` has succeeded and the entities that it created exist.
    :ivar permanent: entities that remain at the end of the state in which they were created.
    :ivar active: whether publishers are enabled, which they also are in transitions to and from
        the state `active`.
    :ivar cycle: control cycle of the active node; None while the node is not active or if it has
        no cycle.
    """

    awaited: ClassVar[tuple[str, ...]] = ()
    idle: ClassVar[str] = 'active'
    base_specs = (ROBOT, AUTOSTART)
    robot: Robot  #: the robot; it is loaded before `configure`
    inputs: Any = None
    configured = active = False
    _failure: Exception | None = None

    # -- Steps that subclasses override --

    def create(self) -> None:
        """Create the entities that exist in all life-cycle states."""

    def read_robot(self) -> Robot:
        """Load the robot that the parameter `robot` names."""
        return load_robot(self.values.robot)

    def _check(self, new: dict[str, Value]) -> None:
        """Raise IsotrussError for invalid parameter values, at `configure` and on changes."""

    def configure(self) -> None:
        """Create publishers and subscriptions; a step of the life cycle."""

    def _apply(self) -> None:
        """Apply the parameter values; called after `configure` and on changes."""

    def activate(self) -> None:
        """Start the timers; a step of the life cycle, with publishers already enabled."""

    def deactivate(self) -> None:
        """Bring the robot to a safe state; publishers are still enabled."""

    def cleanup(self) -> None:
        """Release other resources than entities before the node is unconfigured or finalized."""

    def details(self) -> dict[str, object]:
        """Return additional values, as a dictionary, for the diagnostics of a configured node."""
        return {}

    # -- Public interface --

    def start(self) -> None:
        """Configure and activate the node if `autostart` is set."""
        self.diagnostics = Diagnostics(self, self.describe)
        self.permanent: set[object] = set()
        #: Entities that existed at the start of each life-cycle state, by state.
        self._before: dict[str, dict[Any, Callable[[Any], object]]] = {}
        self.add_on_set_parameters_callback(self._check_change)
        self.add_post_set_parameters_callback(lambda _: self._apply_change())
        log_refusals(self)
        self.create()
        if not self.values.autostart:
            self.diagnostics.set_status('unconfigured', DiagnosticStatus.WARN)
            return
        for step in (self.trigger_configure, self.trigger_activate):
            if step() != SUCCESS:
                raise self._failure

    def stop(self) -> None:
        """Shut down the node before the process ends; publishers are still enabled."""
        try:
            self.trigger_shutdown()
        except RuntimeError:  # of rcl: it was interrupted in a transition, or has ended
            if self.active:
                self.deactivate()

    def fail(self, error: Exception) -> None:
        """Deactivate the node after an uncaught error in a callback; it is then unconfigured."""
        traceback.print_exception(error)
        self._record_failure('run', error)
        if self.active:
            self.trigger_deactivate()

    # -- Transitions, as rclpy calls them --

    def on_configure(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Configure the node; if this fails, destroy the entities that were created."""
        self._enter('configured')
        log_refusals(self)  # which may be simulated since it was unconfigured
        result = self._try_step('configure', self._configure)
        if result != SUCCESS:
            self._release()
        return result

    def on_activate(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Activate the node: first its publishers, then its timers."""
        self._enter('active')
        self.active = True
        super().on_activate(_state)
        self.diagnostics.set_status(self.idle)
        result = self._try_step('activate', self.activate)
        if result != SUCCESS:
            self._disable(_state)
        else:
            names = ', '.join(map(self.resolve_topic_name, self.awaited))
            self.get_logger().info(f'active, waits for {names}')
        return result

    def on_deactivate(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Deactivate the node; after an uncaught error, enter the error state."""
        self._try_step('deactivate', self.deactivate)
        self._disable(_state)
        if self._failure is not None:
            return ERROR
        self.diagnostics.set_status('inactive', DiagnosticStatus.WARN)
        return SUCCESS

    def on_cleanup(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Destroy the entities that `configure` created."""
        if self._try_step('clean up', self._release) != SUCCESS:
            return ERROR
        self.diagnostics.set_status('unconfigured', DiagnosticStatus.WARN)
        return SUCCESS

    def on_shutdown(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the node in any state of the life cycle."""
        if self.active:
            self.on_deactivate(_state)
        self._try_step('clean up', self._release)
        self.diagnostics.set_status('finalized', DiagnosticStatus.WARN)
        return SUCCESS

    def on_error(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Release all resources, so that the node can be configured again."""
        return SUCCESS if self._try_step('clean up', self._release) == SUCCESS else FAILURE

    def _try_step(self, what: str, step: Callable[[], None]) -> TransitionCallbackReturn:
        """Execute a step of the life cycle; record the reason of a failure."""
        try:
            step()
        except Exception as error:  # noqa: BLE001 - the node keeps its services
            return self._record_failure(what, error)
        return SUCCESS

    def _record_failure(self, what: str, error: Exception) -> TransitionCallbackReturn:
        """Store, log and report the reason of a failure, and return the transition's result."""
        known = isinstance(error, IsotrussError)
        self._failure = error if known else IsotrussError(f'{type(error).__name__}: {error}')
        self.get_logger().error(f'could not {what}: {self._failure}')
        self.diagnostics.set_status(f'could not {what}: {self._failure}', DiagnosticStatus.ERROR)
        return FAILURE if known else ERROR

    def _enter(self, state: str) -> None:
        """Record the entities at the start of a state, which are not destroyed at its end."""
        self._failure = None
        self._before[state] = self._list_entities()

    def _disable(self, state: LifecycleState) -> None:
        """Destroy the entities that `activate` created, and disable the publishers."""
        self._destroy_since('active')
        self.cycle = None
        super().on_deactivate(state)
        self.active = False

    def _configure(self) -> None:
        self.robot = self.read_robot()
        self.diagnostics.hardware_id = self.robot.name
        present = self.get_parameters_by_prefix('')
        self._check({name: parameter.value for name, parameter in present.items()})
        self.configure()
        self._apply()
        self.configured = True
        self.diagnostics.set_status('inactive', DiagnosticStatus.WARN)

    def _release(self) -> None:
        self.configured, self.inputs = False, None
        self._destroy_since('configured')
        self.cleanup()

    def _check_change(self, parameters: list[Parameter]) -> SetParametersResult:
        """Return whether parameters can be set; all can be set while the node is unconfigured."""
        new = {parameter.name: parameter.value for parameter in parameters}
        try:
            if 'configured' in self._before:
                if fixed := [name for name in new if name in self.values.fixed]:
                    raise ParameterError(f'parameter {", ".join(fixed)}: {UNCONFIGURED_ONLY}')
                self._check(new)
        except IsotrussError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply_change(self) -> None:
        if self.configured:
            self._apply()
        if self.cycle is not None:
            self.cycle.apply()

    def describe(self) -> dict[str, object]:
        """Return all values for the diagnostics as a dictionary, in any life-cycle state."""
        values = {} if self.cycle is None else self.cycle.summary()
        if self.configured:
            values |= self.details()
        return values if self.inputs is None else values | self.inputs.describe_ages()

    def _list_entities(self) -> dict[Any, Callable[[Any], object]]:
        """Return all entities with their destructors: timers first, publishers last."""
        actions = [w for w in self.waitables if isinstance(w, ActionServer | ActionClient)]
        return (
            dict.fromkeys(self.timers, self.destroy_timer)
            | {action: lambda action: action.destroy() for action in actions}
            | dict.fromkeys(self.services, self.destroy_service)
            | dict.fromkeys(self.clients, self.destroy_client)
            | dict.fromkeys(self.subscriptions, self.destroy_subscription)
            | dict.fromkeys(self.publishers, self.destroy_lifecycle_publisher)
        )

    def _destroy_since(self, state: str) -> None:
        """Destroy the entities that were created since a life-cycle state began."""
        if state not in self._before:
            return
        before = self._before.pop(state)
        for entity, destroy in self._list_entities().items():
            if entity not in before and entity not in self.permanent:
                destroy(entity)
        # rclpy keeps weak references to all former entities of the group: without this, repeated
        # configuration grows the memory.
        references = self.default_callback_group.entities
        references -= {reference for reference in references if reference() is None}


def log_refusals(node: Node) -> None:
    """Make rclpy log errors about negative times and invalid transitions, not raise them."""
    for entity in (*node.subscriptions, *node.services):
        name = getattr(entity, 'topic_name', '') or getattr(entity, 'service_name', '')
        # The callbacks of rclpy itself are methods, until they are replaced here.
        if name.endswith(('/clock', '/change_state')) and inspect.ismethod(entity.callback):
            entity.callback = partial(_try_callback, node, name, entity.callback)


def _try_callback(node: Node, name: str, call: Callable[..., Any], *messages: Any) -> Any:
    """Call a callback and log its errors; return the response if it is a service callback."""
    try:
        return call(*messages)
    except (RuntimeError, ValueError) as error:  # of rclpy; what a step raises is caught there
        node.get_logger().warning(f'{name}: {error}', throttle_duration_sec=1.0)
        return messages[-1]
