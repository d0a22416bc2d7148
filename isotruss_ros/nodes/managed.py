"""Managed nodes: brought up from outside, or on their own where `autostart` says so."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from isotruss_ros.core import IsotrussError
from isotruss_ros.nodes import parameters as params
from isotruss_ros.nodes.diagnostics import Diagnostics, Level
from isotruss_ros.nodes.entities import Entities
from isotruss_ros.nodes.guards import guard_clock, guard_transitions
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

SUCCESS = TransitionCallbackReturn.SUCCESS
FAILURE = TransitionCallbackReturn.FAILURE
ERROR = TransitionCallbackReturn.ERROR


class StartError(IsotrussError, RuntimeError):
    """A node could not be brought up, for a reason that is a mistake of ours."""


class ManagedNode(LifecycleNode):
    """
    Base of the managed nodes. A node fills in the steps and ends its constructor with `start`.

    What `configure` makes (publishers, subscriptions, services, action servers, timers) is
    destroyed by itself at cleanup, what `activate` makes at deactivation. Publishers that must be
    silent while the node is inactive are made by `create_lifecycle_publisher`.

    A step that raises an `IsotrussError` leaves the node in the state before, one that raises
    anything else leaves it unconfigured; the reason is logged and in the diagnostics.

    :ivar diagnostics: `say` there how the node is while it is active.
    :param name: of the node.
    :param specs: of its parameters; `self.values[spec]` are their values.
    :raises IsotrussError: a parameter is of another type or out of range.
    """

    def __init__(
        self,
        name: str,
        specs: Sequence[params.Spec],
        parameter_overrides: Sequence[Parameter] = (),
    ) -> None:
        super().__init__(name, parameter_overrides=list(parameter_overrides))
        self.diagnostics = Diagnostics(self, self.details)
        self._entities = Entities(self)
        self._running = False
        self._failure: Exception | None = None
        try:
            self.values = params.Parameters(
                self, (*specs, params.AUTOSTART), lambda: self.state == 'unconfigured'
            )
        except IsotrussError:
            self.destroy_node()
            raise
        guard_clock(self)
        guard_transitions(self)

    # -- The steps, for the nodes to fill in --

    def configure(self) -> None:
        """Read the parameters, load the robot, make publishers and subscriptions."""

    def activate(self) -> None:
        """Start the timers; publishers are enabled."""

    def deactivate(self) -> None:
        """Leave the robot safe; publishers still work."""

    def cleanup(self) -> None:
        """Let go of what is no entity of the node; called after every `configure`."""

    def details(self) -> dict[str, object]:
        """Return what the diagnostics should show, by name; called in every state."""
        return {}

    # -- From outside --

    @property
    def state(self) -> str:
        """Return the label of the state, such as `inactive`."""
        return self._state_machine.current_state[1]

    @property
    def active(self) -> bool:
        """Return whether publishers are enabled, in the transitions to and from `active` too."""
        return self._running

    def start(self) -> None:
        """
        Configure and activate where `autostart` says so; the last line of a node's constructor.

        :raises IsotrussError: it did not work; the node is destroyed.
        """
        if not self.values[params.AUTOSTART]:
            self.diagnostics.say(Level.WARN, 'unconfigured')
            return
        for step in (self.trigger_configure, self.trigger_activate):
            if step() != SUCCESS:
                reason = self._failure
                self.destroy_node()
                if isinstance(reason, IsotrussError):
                    raise reason
                raise StartError(f'{type(reason).__name__}: {reason}') from reason

    def stop(self) -> None:
        """Leave the robot safe before the process goes; publishers still work."""
        if self.state in ('unconfigured', 'inactive', 'active'):
            self.trigger_shutdown()
        elif self._running:
            self.deactivate()  # interrupted in a transition

    def destroy_node(self) -> None:
        """Destroy the node and what rclpy's state machine holds of it."""
        super().destroy_node()
        self._state_machine.destroy_when_not_in_use()

    def fail(self, error: Exception) -> None:
        """Take an error that escaped a callback: stop, and be unconfigured with the reason."""
        self._note('run', error)
        if self._running:
            self.trigger_deactivate()

    # -- Transitions --

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Configure; what a failure leaves behind is released."""
        self._failure = None
        self._entities.begin('configured')
        result = self._attempt('configure', self.configure)
        if result == SUCCESS:
            result = super().on_configure(state)
        if result != SUCCESS:
            self._release()
            return result
        self.diagnostics.say(Level.WARN, 'inactive')
        return result

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Activate: publishers first, then whatever publishes."""
        self._failure = None
        self._entities.begin('active')
        self._running = True
        super().on_activate(state)
        self.diagnostics.say(Level.OK, 'active')
        result = self._attempt('activate', self.activate)
        if result != SUCCESS:
            self._rest(state)
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Deactivate; with an error that escaped a callback this is the way to the error state."""
        self._attempt('deactivate', self.deactivate)
        self._rest(state)
        if self._failure is not None:
            return ERROR
        self.diagnostics.say(Level.WARN, 'inactive')
        return SUCCESS

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Release all that `configure` made, so that it can be made anew."""
        if self._attempt('clean up', self._release) != SUCCESS:
            return ERROR
        self.diagnostics.say(Level.WARN, 'unconfigured')
        return SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop from any state."""
        if self._running:
            self._attempt('deactivate', self.deactivate)
            self._rest(state)
        self._attempt('clean up', self._release)
        self.diagnostics.say(Level.WARN, 'finalized')
        return SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Release everything: the node can be configured anew unless that fails too."""
        if self._running:
            self._rest(state)
        return SUCCESS if self._attempt('clean up', self._release) == SUCCESS else FAILURE

    def _attempt(self, what: str, step: Callable[[], None]) -> TransitionCallbackReturn:
        """Take a step; note why it failed."""
        try:
            step()
        except IsotrussError as error:
            self._note(what, error)
            return FAILURE
        except Exception as error:  # noqa: BLE001 - whatever it is, the node must stay answerable
            self._note(what, error)
            return ERROR
        return SUCCESS

    def _note(self, what: str, error: Exception) -> None:
        """Keep, log and report a failure."""
        self._failure = error
        known = isinstance(error, IsotrussError)
        reason = str(error) if known else f'{type(error).__name__}: {error}'
        self.get_logger().error(f'could not {what}: {reason}')
        self.diagnostics.say(Level.ERROR, f'could not {what}: {reason}')

    def _rest(self, state: LifecycleState) -> None:
        """Be silent."""
        self._entities.end('active')
        super().on_deactivate(state)
        self._running = False

    def _release(self) -> None:
        self.values.release()
        self._entities.end('configured')
        self.cleanup()
