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


class Interruption:
    """
    Takes Ctrl-C and SIGTERM: the first is for the loop to see, the second one insists.

    It does not raise at first: KeyboardInterrupt in the middle of a conversion from C comes out of
    rclpy as another error, and would be taken for one.
    """

    def __init__(self) -> None:
        self.came = False
        for which in (signal.SIGINT, signal.SIGTERM):
            signal.signal(which, self._take)

    def _take(self, _signal: int, _frame: FrameType | None) -> None:
        if self.came:
            raise KeyboardInterrupt
        self.came = True

    def ignore(self) -> None:
        """Take no more of them."""
        for which in (signal.SIGINT, signal.SIGTERM):
            signal.signal(which, signal.SIG_IGN)


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
    interruption = Interruption()
    node = None
    try:
        try:
            node = make_node()
        except IsotrussError as error:
            print(f'cannot start: {error}', file=sys.stderr)
            return 1
        # What is here by now stays: no need for the garbage collector to walk it between cycles.
        gc.freeze()
        _spin(node, interruption)
    except KeyboardInterrupt:
        pass
    finally:
        interruption.ignore()
        if node is not None:
            node.stop()
            node.destroy_node()
        rclpy.shutdown()
    return 0


def _spin(node: StoppableNode | ManagedNode, interruption: Interruption) -> None:
    """Spin until interrupted; an error out of a callback stops the robot, not the process."""
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while not interruption.came:
        try:
            # A signal ends no wait, but every node has a timer. A time-out would make one anew for
            # every callback.
            executor.spin_once()
        except Exception as error:  # noqa: BLE001 - whatever it is, the robot must stop
            traceback.print_exc()
            node.fail(error)
