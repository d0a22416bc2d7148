# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Run a node as an executable: start or print why not, spin, stop cleanly on a signal."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import gc
import importlib
import signal
import sys
from types import FrameType
from typing import ClassVar

from isotruss_ros.core import IsotrussError
from isotruss_ros.nodes.framework import MODULES
from isotruss_ros.nodes.framework.command_line import explain_refusal, refuse_arguments
from isotruss_ros.nodes.framework.cycle import Cycle, PacedExecutor
from isotruss_ros.nodes.framework.parameters import Parameters, Spec
from isotruss_ros.nodes.framework.reasons import ReasonLog
import rclpy
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from scipy import interpolate, optimize  # noqa: F401 - the core would load them in a cycle
from std_srvs.srv import Trigger

#: Ctrl-C, `kill`, and a terminal that is closed.
STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
#: A wait ends so often, as no signal ends one [s].
WAKE_PERIOD = 1.0


class StoppableNode(Node):
    """
    A node that has to leave the robot safe before the process ends; a subclass overrides `start`.

    :cvar node_name: its name.
    :cvar specs: its parameters.
    :cvar base_specs: those that all nodes of its kind have.
    :cvar done: ends the process where a node has done what it is for.
    :ivar cycle: what the node does at a rate; None if there is nothing.
    :ivar values: of the parameters, as attributes.
    :param parameter_overrides: values of parameters other than the defaults.
    :raises IsotrussError: a parameter is unusable; the text names it and what would be right.
    """

    node_name: ClassVar[str]
    specs: ClassVar[Sequence[Spec]]
    base_specs: ClassVar[Sequence[Spec]] = ()
    done = False
    cycle: Cycle | None = None

    def __init__(self, parameter_overrides: Sequence[Parameter] = ()) -> None:
        super().__init__(
            self.node_name,
            parameter_overrides=list(parameter_overrides),
            automatically_declare_parameters_from_overrides=True,
        )
        self._reasons = ReasonLog(lambda text: self.get_logger().warning(text))
        try:
            self.values = Parameters(self, (*self.base_specs, *self.specs))
            self.start()
        except IsotrussError:
            self.destroy_node()
            raise

    def start(self) -> None:
        """Begin, with the parameters; the last step of the constructor."""

    def begin(self) -> None:
        """
        Begin what only a process of its own has: a file, a server, the keyboard.

        :raises IsotrussError: why it cannot begin.
        """

    def now(self) -> float:
        """Return the time of the node's clock [s]."""
        return 1e-9 * self.get_clock().now().nanoseconds

    def warn(self, kind: str, message: str) -> None:
        """
        Log a warning, once while its reason holds; see `ReasonLog`.

        :param kind: a flood of one kind does not hide another.
        :param message: what is logged.
        """
        self._reasons.note(kind, message)

    def log_ended(self) -> None:
        """Log how often the reasons were given that hold no longer."""
        self._reasons.end()

    def offer(self, name: str, carry_out: Callable[[], str]) -> None:
        """
        Offer a service without arguments.

        :param name: of the service, std_srvs/Trigger.
        :param carry_out: does what is asked for and returns in words what came of it; raises
            IsotrussError where it does not succeed.
        """

        def respond(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            try:
                response.message, response.success = carry_out(), True
            except IsotrussError as error:
                response.message = str(error)
            return response

        self.create_service(Trigger, name, respond)

    def stop(self) -> None:
        """Leave the robot safe; publishers still work."""

    def fail(self, error: Exception) -> None:
        """
        End the process after an error that escaped a callback.

        :param error: raised again; of an IsotrussError, `run` prints what it says.
        """
        raise error


def catch_signals() -> list[int]:
    """
    Return a list that gets the first signal that is to end the process; the second one raises.

    KeyboardInterrupt raised in the middle of a conversion from C comes out of rclpy as another
    error.
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
    """
    Return the class of a node.

    :param name: of the node, its module and its executable.
    """
    module = importlib.import_module(f'isotruss_ros.nodes.{MODULES.get(name, name)}')
    return next(kind for kind in vars(module).values() if getattr(kind, 'node_name', '') == name)


def run(kind: Callable[[], StoppableNode], args: Sequence[str] | None = None) -> int:
    """
    Spin a node until it is interrupted, or done.

    :param kind: class of the node.
    :param args: command line, that of the process when left out.
    :return: exit code: 0 when interrupted, 1 when the node could not start or go on.
    :raises SystemExit: after help that was asked for, or for an argument that is none of ROS.
    """
    refuse_arguments(kind, sys.argv if args is None else args)
    # Of arguments that it cannot parse rcl would print a line that does not say which.
    set_logger_level('rcl', LoggingSeverity.FATAL)
    try:
        # Our own handlers: rclpy's would close the context before the last command is sent.
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except (RuntimeError, UnicodeEncodeError) as error:  # of rcl, and before it
        print(f'cannot start: {explain_refusal(error)}', file=sys.stderr)
        return 1
    set_logger_level('rcl', LoggingSeverity.UNSET)
    received, node, what = catch_signals(), None, 'cannot start'
    try:
        try:
            node = kind()
            node.begin()
            what = 'cannot go on'
            # What exists by now stays: the garbage collector need not walk it between cycles.
            gc.freeze()
            executor = PacedExecutor(node)
            while not (received or node.done):
                try:
                    executor.spin_once(WAKE_PERIOD)
                except Exception as error:  # noqa: BLE001 - whatever it is, the robot must stop
                    node.fail(error)
        except KeyboardInterrupt:
            pass
        finally:
            for which in STOP_SIGNALS:
                signal.signal(which, signal.SIG_IGN)
            if node is not None:
                node.stop()
                node.destroy_node()
    except IsotrussError as error:
        print(f'{what}: {error}', file=sys.stderr)
        return 1
    finally:
        rclpy.shutdown()
    return 0
