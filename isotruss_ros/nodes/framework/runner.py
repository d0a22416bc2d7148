# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Base class of all nodes, and the function that runs a node until a signal stops it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import faulthandler
import gc
import importlib
import signal
import sys
from types import FrameType
from typing import ClassVar

from isotruss_ros.core import IsotrussError
from isotruss_ros.nodes.framework import MODULES, STOP_SIGNALS
from isotruss_ros.nodes.framework.command_line import refuse_arguments, start_ros, StartError
from isotruss_ros.nodes.framework.cycle import Cycle, PacedExecutor
from isotruss_ros.nodes.framework.diagnostics import ReasonLog
from isotruss_ros.nodes.framework.parameters import Parameters, Spec
from isotruss_ros.nodes.framework.rclpy_handles import read_overrides
from isotruss_ros.nodes.framework.topics import NO_PUBLISHER_EVENTS, RELIABLE
import rclpy
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.timer import Timer
from scipy import interpolate, optimize  # noqa: F401 - imported before the first cycle
from std_srvs.srv import Trigger

#: Longest wait of the executor [s], because a signal does not interrupt a wait.
WAKE_PERIOD = 1.0
#: Longest time from a signal to the end of the process [s]; the middleware once did not return.
END_TIMEOUT = 20.0


class StoppableNode(Node):
    """
    Node that stops the robot before its process ends; subclasses override `start`.

    :cvar node_name: name of the node.
    :cvar specs: parameters of the node.
    :cvar base_specs: parameters that a base class adds to those of all its subclasses.
    :cvar done: whether the node has finished its task, after which the process ends.
    :ivar values: values of the parameters, as attributes.
    """

    node_name: ClassVar[str]
    specs: ClassVar[Sequence[Spec]]
    base_specs: ClassVar[Sequence[Spec]] = ()
    done = False
    cycle: Cycle | None = None  #: control cycle; None without a cycle

    def __init__(self, parameter_overrides: Sequence[Parameter] = ()) -> None:
        super().__init__(
            self.node_name,
            parameter_overrides=list(parameter_overrides),
        )
        self.reasons = ReasonLog(lambda text: self.get_logger().warning(text))
        try:
            specs = (*self.base_specs, *self.specs)
            overrides = read_overrides(self, [spec.name for spec in specs])
            overrides |= {override.name: override for override in parameter_overrides}
            self.values = Parameters(self, specs, overrides)
            self.start()
        except IsotrussError:
            self.destroy_node()
            raise

    def start(self) -> None:
        """Start the task of the node, as the last step of the constructor."""

    def begin(self) -> None:
        """Open resources of the process, such as a file or a server."""

    def now(self) -> float:
        """Return the time of the node's clock [s]."""
        return 1e-9 * self.get_clock().now().nanoseconds

    def offer(self, name: str, carry_out: Callable[[], str]) -> None:
        """
        Offer a service that takes no arguments (std_srvs/Trigger).

        :param carry_out: function that executes the request and returns a sentence with the
            result; it raises IsotrussError on failure.
        """

        def respond(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            try:
                response.message, response.success = carry_out(), True
            except IsotrussError as error:
                response.message = str(error)
            return response

        self.create_service(Trigger, name, respond)

    def advertise(self, kind: type, topic: str, profile: QoSProfile = RELIABLE) -> Publisher:
        """Return a publisher, which is silent while a managed node is inactive."""
        create = getattr(self, 'create_lifecycle_publisher', self.create_publisher)
        return create(kind, topic, profile, event_callbacks=NO_PUBLISHER_EVENTS)

    def create_steady_timer(self, period: float, callback: Callable[[], None]) -> Timer:
        """
        Return a timer of the steady clock, unaffected by simulated time and clock changes.

        :param period: period of the callbacks [s].
        """
        return self.create_timer(period, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def stop(self) -> None:
        """Bring the robot to a safe state; publishers are still enabled."""

    def fail(self, error: Exception) -> None:
        """
        End the process because of an uncaught error in a callback.

        :param error: error, which is raised again; `run` prints the text of an IsotrussError.
        """
        raise error


def catch_signals() -> list[int]:
    """
    Catch stop signals, and return a list to which the first received signal is appended.

    The second signal raises KeyboardInterrupt. The first one raises nothing, because rclpy may
    replace an exception by another error.
    """
    received: list[int] = []

    def handle(which: int, _frame: FrameType | None) -> None:
        if received:
            raise KeyboardInterrupt
        received.append(which)

    for which in STOP_SIGNALS:
        signal.signal(which, handle)
    return received


def find_node(name: str) -> type[StoppableNode]:
    """Return the class of a node by its name."""
    module = importlib.import_module(f'isotruss_ros.nodes.{MODULES.get(name, name)}')
    return next(kind for kind in vars(module).values() if getattr(kind, 'node_name', '') == name)


def run(kind: Callable[[], StoppableNode], args: Sequence[str] | None = None) -> int:
    """
    Execute a node until it is interrupted or finished.

    :return: exit code, 0 if the node was interrupted or finished, 1 after an error.
    """
    try:
        refuse_arguments(kind, args)
        # Own handlers: those of rclpy would close the context before the last command is sent.
        start_ros(args, SignalHandlerOptions.NO)
    except StartError as error:
        print(f'cannot start: {error}', file=sys.stderr)
        return 1
    received, node, what = catch_signals(), None, 'cannot start'
    try:
        try:
            node = kind()
            node.begin()
            what = 'cannot go on'
            # Existing objects are permanent: the garbage collector can skip them between cycles.
            gc.freeze()
            executor = PacedExecutor(node)
            while not (received or node.done):
                try:
                    executor.spin_once(WAKE_PERIOD)
                except Exception as error:  # noqa: BLE001 - the robot must stop
                    node.fail(error)
        except KeyboardInterrupt:
            pass
        finally:
            for which in STOP_SIGNALS:
                signal.signal(which, signal.SIG_IGN)
            faulthandler.dump_traceback_later(END_TIMEOUT, exit=True)
            if node is not None:
                node.stop()
                node.reasons.end(0.0)
                node.destroy_node()
    except IsotrussError as error:
        print(f'{what}: {error}', file=sys.stderr)
        return 1
    finally:
        rclpy.shutdown()
    return 0
