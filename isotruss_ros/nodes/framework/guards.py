# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What rclpy would raise on out of a callback, and is dropped or rejected instead."""

from __future__ import annotations

import inspect

from lifecycle_msgs.srv import ChangeState
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.service import Service
from rclpy.subscription import Subscription
from rosgraph_msgs.msg import Clock


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


def find_service(node: Node, name: str) -> Service:
    """
    Return a service that a node offers.

    :param node: offers it.
    :param name: relative to the node.
    """
    full = node.resolve_service_name(name)
    (service,) = (service for service in node.services if service.service_name == full)
    return service


def reject_unknown_transitions(node: LifecycleNode) -> None:
    """
    Reject a transition that does not exist in the present state, on which rclpy would raise.

    :param node: whose service is asked for transitions.
    """
    service = find_service(node, '~/change_state')
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
