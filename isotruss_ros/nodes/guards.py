"""What rclpy would die of, kept from it."""

from __future__ import annotations

from lifecycle_msgs.srv import ChangeState
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode
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


def guard_transitions(node: LifecycleNode) -> None:
    """Refuse to change the state by a transition that there is not from the present one."""
    service = node._service_change_state
    change = service.callback

    def guarded(
        request: ChangeState.Request, response: ChangeState.Response
    ) -> ChangeState.Response:
        try:
            return change(request, response)
        except rclpy_implementation.RCLError as error:
            asked = request.transition.label or request.transition.id
            node.get_logger().error(f'no transition {asked!r} from this state: {error}')
            response.success = False
            return response

    service.callback = guarded
