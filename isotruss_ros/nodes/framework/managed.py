# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Managed (lifecycle) nodes; with the parameter `autostart` they activate themselves."""

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
    Base of the managed nodes; a subclass overrides the steps.

    What `configure` creates (publishers, subscriptions, services, action servers, timers) is
    destroyed at cleanup, what `activate` creates at deactivation. Publishers that must not publish
    while the node is inactive are created by `create_lifecycle_publisher`.

    A step that raises an `IsotrussError` leaves the node in the state before, one that raises
    anything else leaves it unconfigured; the reason is logged and in the diagnostics.

    :cvar awaited: topics and actions without which the active node does nothing, as it logs.
    :ivar robot: loaded before `configure`.
    :ivar inputs: the `Inputs` that `configure` has made, whose ages are reported; None without.
    :ivar configured: whether `configure` has succeeded, and what it made is there.
    :ivar kept: entities that outlive the state in which they were created.
    :ivar active: whether publishers are enabled, in the transitions to and from `active` too.
    :ivar diagnostics: status of the node.
    :ivar cycle: None while the node is not active, too.
    """

    awaited: ClassVar[tuple[str, ...]] = ()
    base_specs = (ROBOT, AUTOSTART)
    robot: Robot
    inputs: Any = None
    configured = active = False
    _failure: Exception | None = None

    # -- The steps, for subclasses to override --

    def create(self) -> None:
        """Create what is there in every state."""

    def read_robot(self) -> Robot:
        """Return the robot of the parameters."""
        return load_robot(self.values.robot)

    def _check(self, new: dict[str, Value]) -> None:
        """Refuse unusable values of parameters by name, at `configure` and when they change."""

    def configure(self) -> None:
        """Create publishers and subscriptions."""

    def _apply(self) -> None:
        """Take the values of the parameters, after `configure` and when they have changed."""

    def activate(self) -> None:
        """Start the timers; publishers are enabled."""

    def deactivate(self) -> None:
        """Leave the robot safe; publishers still work."""

    def cleanup(self) -> None:
        """Release what is no entity of the node; called after every `configure`."""

    def details(self) -> dict[str, object]:
        """Return values for the diagnostics of the configured node by name, besides cycles."""
        return {}

    # -- Public interface --

    def start(self) -> None:
        """
        Configure and activate where `autostart` is set.

        :raises IsotrussError: a step failed.
        """
        self.diagnostics = Diagnostics(self, self.describe)
        self.kept: set[object] = set()
        #: The entities that were there before each state.
        self._before: dict[str, dict[Any, Callable[[Any], object]]] = {}
        self.add_on_set_parameters_callback(self._check_change)
        self.add_post_set_parameters_callback(lambda _: self._apply_change())
        log_refusals(self)
        self.create()
        if not self.values.autostart:
            self.diagnostics.set_status(DiagnosticStatus.WARN, 'unconfigured')
            return
        for step in (self.trigger_configure, self.trigger_activate):
            if step() != SUCCESS:
                raise self._failure

    def stop(self) -> None:
        """Shut the node down before the process ends; publishers still work."""
        try:
            self.trigger_shutdown()
        except RuntimeError:  # of rcl: it was interrupted in a transition, or has ended
            if self.active:
                self.deactivate()

    def fail(self, error: Exception) -> None:
        """
        Deactivate after an error that escaped a callback; the node is unconfigured afterwards.

        :param error: logged and reported as the reason.
        """
        traceback.print_exception(error)
        self._record_failure('run', error)
        if self.active:
            self.trigger_deactivate()

    # -- Transitions, as rclpy calls them --

    def on_configure(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Configure; release what a failure leaves behind."""
        self._enter('configured')
        log_refusals(self)  # which may be simulated since it was unconfigured
        result = self._try_step('configure', self._configure)
        if result != SUCCESS:
            self._release()
        return result

    def on_activate(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Activate: publishers first, then the timers that publish."""
        self._enter('active')
        self.active = True
        super().on_activate(_state)
        self.diagnostics.set_status(DiagnosticStatus.OK, 'active')
        result = self._try_step('activate', self.activate)
        if result != SUCCESS:
            self._disable(_state)
        else:
            names = ', '.join(map(self.resolve_topic_name, self.awaited))
            self.get_logger().info(f'active, waits for {names}')
        return result

    def on_deactivate(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Deactivate; after an error that escaped a callback this leads to the error state."""
        self._try_step('deactivate', self.deactivate)
        self._disable(_state)
        if self._failure is not None:
            return ERROR
        self.diagnostics.set_status(DiagnosticStatus.WARN, 'inactive')
        return SUCCESS

    def on_cleanup(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Release all that `configure` created, so that it can be created again."""
        if self._try_step('clean up', self._release) != SUCCESS:
            return ERROR
        self.diagnostics.set_status(DiagnosticStatus.WARN, 'unconfigured')
        return SUCCESS

    def on_shutdown(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Stop from any state."""
        if self.active:
            self.on_deactivate(_state)
        self._try_step('clean up', self._release)
        self.diagnostics.set_status(DiagnosticStatus.WARN, 'finalized')
        return SUCCESS

    def on_error(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Release everything: the node can be configured again unless that fails too."""
        return SUCCESS if self._try_step('clean up', self._release) == SUCCESS else FAILURE

    def _try_step(self, what: str, step: Callable[[], None]) -> TransitionCallbackReturn:
        """Run a step; record why it failed."""
        try:
            step()
        except Exception as error:  # noqa: BLE001 - whatever it is, the node keeps its services
            return self._record_failure(what, error)
        return SUCCESS

    def _record_failure(self, what: str, error: Exception) -> TransitionCallbackReturn:
        """Keep, log and report the reason of a failure; return what it makes of a transition."""
        known = isinstance(error, IsotrussError)
        self._failure = error if known else IsotrussError(f'{type(error).__name__}: {error}')
        self.get_logger().error(f'could not {what}: {self._failure}')
        self.diagnostics.set_status(DiagnosticStatus.ERROR, f'could not {what}: {self._failure}')
        return FAILURE if known else ERROR

    def _enter(self, state: str) -> None:
        """Note the entities that are there before a state, whose end they outlive."""
        self._failure = None
        self._before[state] = self._list_entities()

    def _disable(self, state: LifecycleState) -> None:
        """Destroy what `activate` created and disable the publishers."""
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
        self.diagnostics.set_status(DiagnosticStatus.WARN, 'inactive')

    def _release(self) -> None:
        self.configured, self.inputs = False, None
        self._destroy_since('configured')
        self.cleanup()

    def _check_change(self, parameters: list[Parameter]) -> SetParametersResult:
        """Return whether parameters can be set, as any can while the node is unconfigured."""
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
        """Return all values for the diagnostics by name, in any state."""
        found = {} if self.cycle is None else self.cycle.summary()
        if self.configured:
            found |= self.details()
        return found if self.inputs is None else found | self.inputs.describe_ages()

    def _list_entities(self) -> dict[Any, Callable[[Any], object]]:
        """Return every entity with what destroys it: timers first and publishers last."""
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
        """Destroy what was created since a state began."""
        if state not in self._before:
            return
        before = self._before.pop(state)
        for entity, destroy in self._list_entities().items():
            if entity not in before and entity not in self.kept:
                destroy(entity)
        # rclpy keeps a weak reference to everything that ever was in the group: without this, a
        # node that is configured again and again grows.
        references = self.default_callback_group.entities
        references -= {reference for reference in references if reference() is None}


def log_refusals(node: Node) -> None:
    """
    Log what rclpy itself would raise of a time before zero, or of a transition that there is not.

    :param node: may go by simulated time, and may have states.
    """
    for entity in (*node.subscriptions, *node.services):
        name = getattr(entity, 'topic_name', '') or getattr(entity, 'service_name', '')
        # The callbacks of rclpy itself are methods, until they are replaced here.
        if name.endswith(('/clock', '/change_state')) and inspect.ismethod(entity.callback):
            entity.callback = partial(_try_callback, node, name, entity.callback)


def _try_callback(node: Node, name: str, call: Callable[..., Any], *messages: Any) -> Any:
    """Return the response of a service, where it refuses too; none of a subscription."""
    try:
        return call(*messages)
    except (RuntimeError, ValueError) as error:  # of rclpy; what a step raises is caught there
        node.get_logger().warning(f'{name}: {error}', throttle_duration_sec=1.0)
        return messages[-1]
