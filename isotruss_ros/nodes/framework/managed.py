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
import traceback
from typing import ClassVar

from isotruss_ros.core import IsotrussError
from isotruss_ros.nodes.framework import parameters as params
from isotruss_ros.nodes.framework.cycle import Cycle
from isotruss_ros.nodes.framework.diagnostics import Diagnostics, Level
from isotruss_ros.nodes.framework.entity_scopes import EntityScopes
from isotruss_ros.nodes.framework.guards import (
    find_service,
    ignore_negative_time,
    reject_unknown_transitions,
)
from lifecycle_msgs.srv import GetState
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

SUCCESS = TransitionCallbackReturn.SUCCESS
FAILURE = TransitionCallbackReturn.FAILURE
ERROR = TransitionCallbackReturn.ERROR


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
    #: It runs until it is interrupted.
    done: ClassVar[bool] = False

    def __init__(
        self,
        name: str,
        specs: Sequence[params.Spec],
        parameter_overrides: Sequence[Parameter] = (),
    ) -> None:
        super().__init__(
            name,
            parameter_overrides=list(parameter_overrides),
            automatically_declare_parameters_from_overrides=True,
        )
        self.diagnostics = Diagnostics(self, self.details)
        self._entities = EntityScopes(self)
        self._get_state = find_service(self, '~/get_state').callback
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
        reject_unknown_transitions(self)

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
        answer = self._get_state(GetState.Request(), GetState.Response())
        return answer.current_state.label

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
                raise IsotrussError(f'{type(reason).__name__}: {reason}') from reason

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

    def report_end(self, idle: str, text: str, good: bool) -> None:
        """
        Report how a goal has ended, in the diagnostics and the log.

        :param idle: what the node does from now on.
        :param text: how the goal ended.
        :param good: whether that is no warning.
        """
        level = Level.OK if good else Level.WARN
        self.diagnostics.set_status(level, f'{idle}; last goal {text}')
        if good:
            self.get_logger().info(text)
        else:
            self.get_logger().warning(text)

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
