"""Run a node as an executable: start or say why not, spin, stop cleanly on Ctrl-C or SIGTERM."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import gc
import signal
import sys
from types import FrameType

from isotruss_ros.core import IsotrussError
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions


class StoppableNode(Node):
    """A node that has something to do before it goes."""

    def stop(self) -> None:
        """Leave the robot safe; publishers still work."""


def _interrupt(_signal: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def run(make_node: Callable[[], StoppableNode], args: Sequence[str] | None = None) -> int:
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
        node = make_node()
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        # What is here by now stays: no need for the garbage collector to walk it between cycles.
        gc.freeze()
        executor.spin()
    except IsotrussError as error:
        print(f'cannot start: {error}', file=sys.stderr)
        return 1
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
