# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Undocumented methods of rclpy's handles, each with its benefit and a substitute.

Nodes run with a version of rclpy that lacks any of them.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.subscription import Subscription
from rclpy.timer import Timer


def can_pace(timer: Timer, subscriptions: Iterable[Subscription]) -> bool:
    """
    Return whether rclpy has the methods that `PacedExecutor` needs; else rclpy executes the node.

    A cycle at 100 Hz that receives from ten publishers at 100 Hz then takes 1.7 times the
    processor time. Without `take_message`, `PacedExecutor` would take one message per cycle, and
    miss some publishers altogether.
    """
    can_take = all(hasattr(subscription.handle, 'take_message') for subscription in subscriptions)
    return can_take and hasattr(timer.handle, 'call_timer')


def call_timer(timer: Timer) -> None:
    """Count a period of a timer, whose callback the caller executes; see `can_pace`."""
    timer.handle.call_timer()


def take_message(subscription: Subscription) -> tuple[Any, dict[str, Any]] | None:
    """
    Return the next queued message of a subscription with its information; None without one.

    Without this method the result is None, and executors of rclpy take the message.
    """
    take = getattr(subscription.handle, 'take_message', None)
    return None if take is None else take(subscription.msg_type, subscription.raw)


def read_overrides(node: Node, names: Iterable[str]) -> dict[str, Parameter]:
    """
    Return the overrides of a node's parameters, by their names.

    The method reads overrides with unknown names, and empty lists, which rclpy cannot declare.
    Without it, only overrides of parameters with given names are read, and no empty lists.
    """
    if hasattr(node.handle, 'get_parameters'):
        with node.handle:
            return node.handle.get_parameters(Parameter)
    overrides = {}
    for name in names:
        parameter = node.declare_parameter(name, None, ParameterDescriptor(dynamic_typing=True))
        node.undeclare_parameter(name)
        if parameter.type_ is not Parameter.Type.NOT_SET:
            overrides[name] = parameter
    return overrides
