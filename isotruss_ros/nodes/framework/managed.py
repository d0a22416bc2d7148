# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Managed (lifecycle) nodes; with the parameter `autostart` they activate themselves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import inspect
import traceback
from typing import Any, ClassVar

from isotruss_ros.core import IsotrussError
from isotruss_ros.nodes.framework import parameters as params
from isotruss_ros.nodes.framework.cycle import Cycle
from isotruss_ros.nodes.framework.diagnostics import Diagnostics, Level
from lifecycle_msgs.srv import ChangeState
from rclpy.action import ActionClient, ActionServer
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.lifecycle.publisher import LifecyclePublisher
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.subscription import Subscription
from rosgraph_msgs.msg import Clock

SUCCESS = TransitionCallbackReturn.SUCCESS
FAILURE = TransitionCallbackReturn.FAILURE
ERROR = TransitionCallbackReturn.ERROR
NO_EVENTS = PublisherEventCallbacks(use_default_callbacks=False)


class StartError(IsotrussError, RuntimeError):
    """A node could not be activated because of an error that is not an IsotrussError."""


class ManagedNode(LifecycleNode):
    """
    Base of the managed nodes; a subclass overrides the steps and calls `start` last when created.

    What `configure` creates (publishers, subscriptions, services, action servers, timers) is
    destroyed at cleanup, what `activate` creates at deactivation. Publishers that must not publish
    while the node is inactive are created by `create_lifecycle_publisher`.

    A step that raises an `IsotrussError` leaves the node in the state before, one that raises
    anything else leaves it unconfigured; the reason is logged and in the diagnostics.

    :cvar awaited: topics and actions without which the active node does nothing, as it logs.
    :ivar diagnostics: status of the node while it is active.
    :ivar cycle: what the node does at a rate, while it is active; None if there is nothing.
    :ivar values: of the parameters, as `values[spec]`.
    :param name: name of the node.
    :param specs: its parameters, besides `autostart`.
    :param parameter_overrides: values of parameters other than the defaults.
    :raises IsotrussError: a parameter is of another type or out of range.
    """

    awaited: ClassVar[tuple[str, ...]] = ()

    def __init__(
        self,
        name: str,
        specs: Sequence[params.Spec],
        parameter_overrides: Sequence[Parameter] = (),
    ) -> None:
        super().__init__(name, parameter_overrides=list(parameter_overrides))
        self.diagnostics = Diagnostics(self, self.details)
        self._entities = _EntityScopes(self)
        self.cycle: Cycle | None = None
        self._running = False
        self._failure: Exception | None = None
        try:
            self.values = params.Parameters(
                self, (*specs, params.AUTOSTART), lambda: self.state == 'unconfigured'
            )
        except IsotrussError:
            self.destroy_node()
            raise
        ignore_negative_time(self)
        _reject_unknown_transitions(self)

    # -- The steps, for subclasses to override --

    def configure(self) -> None:
        """Read the parameters, load the robot, create publishers and subscriptions."""

    def activate(self) -> None:
        """Start the timers; publishers are enabled."""

    def deactivate(self) -> None:
        """Leave the robot safe; publishers still work."""

    def cleanup(self) -> None:
        """Release what is no entity of the node; called after every `configure`."""

    def details(self) -> dict[str, object]:
        """Return values for the diagnostics by name; called in every state."""
        return {}

    # -- Public interface --

    @property
    def state(self) -> str:
        """Return the label of the state, such as `inactive`."""
        return self._state_machine.current_state[1]

    @property
    def active(self) -> bool:
        """Return whether publishers are enabled, in the transitions to and from `active` too."""
        return self._running

    def now(self) -> float:
        """Return the time of the node's clock [s]."""
        return 1e-9 * self.get_clock().now().nanoseconds

    def start(self) -> None:
        """
        Configure and activate where `autostart` is set; the last line of a node's constructor.

        :raises IsotrussError: a step failed; the node is destroyed.
        """
        if not self.values[params.AUTOSTART]:
            self.diagnostics.set_status(Level.WARN, 'unconfigured')
            return
        for step in (self.trigger_configure, self.trigger_activate):
            if step() != SUCCESS:
                reason = self._failure
                self.destroy_node()
                if isinstance(reason, IsotrussError):
                    raise reason
                raise StartError(f'{type(reason).__name__}: {reason}') from reason

    def stop(self) -> None:
        """Shut the node down before the process ends; publishers still work."""
        if self.state in ('unconfigured', 'inactive', 'active'):
            self.trigger_shutdown()
        elif self._running:
            self.deactivate()  # interrupted in a transition

    def destroy_node(self) -> None:
        """Destroy the node and the state machine of rclpy that refers to it."""
        super().destroy_node()
        self._state_machine.destroy_when_not_in_use()

    def create_lifecycle_publisher(self, *arguments: Any, **options: Any) -> LifecyclePublisher:
        """
        Create a publisher without the events of rclpy, each of which costs in every cycle.

        :param arguments: as rclpy has them.
        :param options: likewise.
        """
        options.setdefault('event_callbacks', NO_EVENTS)
        return super().create_lifecycle_publisher(*arguments, **options)

    def keep(self, entity: object) -> None:
        """
        Have an entity outlive the present state, as if it had been created with the node.

        :param entity: of this node.
        """
        self._entities.keep(entity)

    def fail(self, error: Exception) -> None:
        """
        Deactivate after an error that escaped a callback; the node is unconfigured afterwards.

        :param error: logged and reported as the reason.
        """
        traceback.print_exception(error)
        self._record_failure('run', error)
        if self._running:
            self.trigger_deactivate()

    # -- Transitions --

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """
        Configure; release what a failure leaves behind.

        :param state: the state before.
        """
        self._failure = None
        ignore_negative_time(self)  # which may be simulated since it was unconfigured
        self._entities.begin('configured')
        result = self._try_step('configure', self.configure)
        if result == SUCCESS:
            result = super().on_configure(state)
        if result != SUCCESS:
            self._release()
            return result
        self.diagnostics.set_status(Level.WARN, 'inactive')
        return result

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """
        Activate: publishers first, then the timers that publish.

        :param state: the state before.
        """
        self._failure = None
        self._entities.begin('active')
        self._running = True
        super().on_activate(state)
        self.diagnostics.set_status(Level.OK, 'active')
        result = self._try_step('activate', self.activate)
        if result != SUCCESS:
            self._disable(state)
            return result
        names = ', '.join(map(self.resolve_topic_name, self.awaited))
        self.get_logger().info(f'active, waits for {names}')
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """
        Deactivate; after an error that escaped a callback this leads to the error state.

        :param state: the state before.
        """
        self._try_step('deactivate', self.deactivate)
        self._disable(state)
        if self._failure is not None:
            return ERROR
        self.diagnostics.set_status(Level.WARN, 'inactive')
        return SUCCESS

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """
        Release all that `configure` created, so that it can be created again.

        :param state: the state before.
        """
        if self._try_step('clean up', self._release) != SUCCESS:
            return ERROR
        self.diagnostics.set_status(Level.WARN, 'unconfigured')
        return SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """
        Stop from any state.

        :param state: the state before.
        """
        if self._running:
            self._try_step('deactivate', self.deactivate)
            self._disable(state)
        self._try_step('clean up', self._release)
        self.diagnostics.set_status(Level.WARN, 'finalized')
        return SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """
        Release everything: the node can be configured again unless that fails too.

        :param state: the state before.
        """
        if self._running:
            self._disable(state)
        return SUCCESS if self._try_step('clean up', self._release) == SUCCESS else FAILURE

    def _try_step(self, what: str, step: Callable[[], None]) -> TransitionCallbackReturn:
        """Run a step; record why it failed."""
        try:
            step()
        except IsotrussError as error:
            self._record_failure(what, error)
            return FAILURE
        except Exception as error:  # noqa: BLE001 - whatever it is, the node keeps its services
            self._record_failure(what, error)
            return ERROR
        return SUCCESS

    def _record_failure(self, what: str, error: Exception) -> None:
        """Keep, log and report the reason of a failure."""
        self._failure = error
        known = isinstance(error, IsotrussError)
        reason = str(error) if known else f'{type(error).__name__}: {error}'
        self.get_logger().error(f'could not {what}: {reason}')
        self.diagnostics.set_status(Level.ERROR, f'could not {what}: {reason}')

    def _disable(self, state: LifecycleState) -> None:
        """Destroy what `activate` created and disable the publishers."""
        self._entities.end('active')
        super().on_deactivate(state)
        self._running = False

    def _release(self) -> None:
        self.values.release()
        self._entities.end('configured')
        self.cleanup()


class _EntityScopes:
    """
    Destroy what was created since a state began; what was there before stays.

    :param node: creates the entities, by the methods of rclpy.
    """

    def __init__(self, node: LifecycleNode) -> None:
        self._node = node
        self._before: dict[str, dict[int, object]] = {}

    def begin(self, state: str) -> None:
        """Record what is there before a state begins."""
        self._before[state] = {id(entity): entity for entity, _ in self._list()}

    def create_lifecycle_publisher(self, *arguments: Any, **options: Any) -> LifecyclePublisher:
        """
        Create a publisher without the events of rclpy, each of which costs in every cycle.

        :param arguments: as rclpy has them.
        :param options: likewise.
        """
        options.setdefault('event_callbacks', NO_EVENTS)
        return super().create_lifecycle_publisher(*arguments, **options)

    def keep(self, entity: object) -> None:
        """Leave an entity there when the present states end."""
        for before in self._before.values():
            before[id(entity)] = entity

    def end(self, state: str) -> None:
        """Destroy what was created since: timers first and publishers last."""
        before = self._before.pop(state, None)
        if before is None:
            return
        for entity, destroy in self._list():
            if id(entity) not in before:
                destroy(entity)
        # rclpy keeps a weak reference to everything that ever was in the group: without this, a
        # node that is configured again and again grows.
        references = self._node.default_callback_group.entities
        references -= {reference for reference in references if reference() is None}

    def _list(self) -> list[tuple[object, object]]:
        """Return every entity and the method that destroys it."""
        node = self._node
        actions = [w for w in node.waitables if isinstance(w, ActionServer | ActionClient)]
        return [
            *((timer, node.destroy_timer) for timer in node.timers),
            *((action, lambda action: action.destroy()) for action in actions),
            *((service, node.destroy_service) for service in node.services),
            *((client, node.destroy_client) for client in node.clients),
            *((subscribed, node.destroy_subscription) for subscribed in node.subscriptions),
            *((publisher, node.destroy_lifecycle_publisher) for publisher in node.publishers),
        ]


def ignore_negative_time(node: Node) -> None:
    """
    Drop messages on `/clock` with a time before zero, on which rclpy would raise.

    :param node: a node that may go by simulated time.
    """
    for subscription in node.subscriptions:
        # The callback of rclpy itself is a method.
        if subscription.topic_name == '/clock' and inspect.ismethod(subscription.callback):
            _check_times(subscription, node.get_logger())


def _check_times(subscription: Subscription, logger: RcutilsLogger) -> None:
    take = subscription.callback

    def take_checked(message: Clock) -> None:
        if message.clock.sec >= 0:
            take(message)
            return
        logger.warning(
            f'/clock: {message.clock.sec} s is before zero; the time stays as it is',
            throttle_duration_sec=1.0,
        )

    subscription.callback = take_checked


def _reject_unknown_transitions(node: LifecycleNode) -> None:
    """Reject a transition that does not exist in the present state, on which rclpy would raise."""
    name = node.resolve_service_name('~/change_state')
    (service,) = (service for service in node.services if service.service_name == name)
    change = service.callback

    def change_checked(
        request: ChangeState.Request, response: ChangeState.Response
    ) -> ChangeState.Response:
        try:
            return change(request, response)
        except rclpy_implementation.RCLError as error:
            transition = request.transition.label or request.transition.id
            node.get_logger().error(f'no transition {transition!r} from this state: {error}')
            response.success = False
            return response

    service.callback = change_checked
