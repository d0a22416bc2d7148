"""Run a node as an executable: start or say why not, spin, stop cleanly on Ctrl-C or SIGTERM."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import gc
import signal
import sys
import traceback
from types import FrameType

from isotruss_ros.core import IsotrussError
from isotruss_ros.nodes.managed import ManagedNode
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions


class StoppableNode(Node):
    """A node that has something to do before it goes."""

    def stop(self) -> None:
        """Leave the robot safe; publishers still work."""

    def fail(self, error: Exception) -> None:
        """Take an error that escaped a callback: the process ends."""
        raise error


def _interrupt(_signal: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def run(
    make_node: Callable[[], StoppableNode | ManagedNode], args: Sequence[str] | None = None
) -> int:
    """
    Spin a node until it is interrupted.

    :param make_node: makes the node; may raise IsotrussError.
    :param args: command line, that of the process when left out.
    :return: exit code: 0 when interrupted, 1 when the node could not start.
    """
    # Our own handlers: rclpy's would close the context before the last command is sent.
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    node = None
    try:
        signal.signal(signal.SIGINT, _interrupt)
        signal.signal(signal.SIGTERM, _interrupt)
        try:
            node = make_node()
        except IsotrussError as error:
            print(f'cannot start: {error}', file=sys.stderr)
            return 1
        # What is here by now stays: no need for the garbage collector to walk it between cycles.
        gc.freeze()
        _spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        if node is not None:
            node.stop()
            node.destroy_node()
        rclpy.shutdown()
    return 0


def _spin(node: StoppableNode | ManagedNode) -> None:
    """Spin for ever; an error that escapes a callback stops the robot, not the process."""
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while True:
        try:
            executor.spin()
        except Exception as error:  # noqa: BLE001 - whatever it is, the robot must stop
            traceback.print_exc()
            node.fail(error)
