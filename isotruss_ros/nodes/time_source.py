"""Simulated time that cannot be is not taken; rclpy would die of it."""

from __future__ import annotations

from rclpy.node import Node
from rosgraph_msgs.msg import Clock


def guard_clock(node: Node) -> None:
    """Drop messages on `/clock` with a time before zero, now and whenever the node subscribes."""
    source = node._time_source
    take = source.clock_callback

    def guarded(message: Clock) -> None:
        if message.clock.sec < 0:
            node.get_logger().warning(
                f'/clock: {message.clock.sec} s is before zero; the time stays as it is',
                throttle_duration_sec=1.0,
            )
            return
        take(message)

    source.clock_callback = guarded
    if source._clock_sub is not None:
        source._clock_sub.callback = guarded
