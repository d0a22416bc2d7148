# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Topics, services, actions and parameters of the nodes, read from running nodes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
import gc
from typing import Any

from isotruss_ros.executables import NODES
from isotruss_ros.nodes.framework.runner import find_node
import rclpy
from rclpy.action import get_action_server_names_and_types_by_node
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import HistoryPolicy, QoSProfile

#: Topics that all nodes have by rclpy or by our framework.
COMMON_TOPICS = ('/rosout', '/parameter_events', '/clock', '/diagnostics', '/tf')
COMMON_PARAMETERS = ('use_sim_time', 'start_type_description_service')
COMMON_PACKAGES = ('rcl_interfaces', 'lifecycle_msgs', 'type_description_interfaces')


@dataclass
class Entity:
    """Types and qualities of service of a topic, service or action."""

    types: list[str] = field(default_factory=list)
    qos: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Declared:
    """Declaration of a parameter."""

    name: str
    default: Any
    description: str
    range: str
    when: str


@dataclass
class Interface:
    """Declarations of a node, by name."""

    subscribed: dict[str, Entity] = field(default_factory=dict)
    published: dict[str, Entity] = field(default_factory=dict)
    services: dict[str, Entity] = field(default_factory=dict)
    actions: dict[str, Entity] = field(default_factory=dict)
    parameters: list[Declared] = field(default_factory=list)


def node_classes() -> dict[str, Callable[..., Node]]:
    """Return the classes of the nodes by the names of their executables."""
    return {name: find_node(name) for name in sorted(NODES)}


def interfaces() -> dict[str, Interface]:
    """Start the nodes one after another, and return the interface of each."""
    found = {}
    gc.freeze()  # collections after each node do not examine the objects from before
    for name, kind in node_classes().items():
        found[name] = _interface(kind)
        switch = 'use_stamped_twist'
        if any(p.name == switch for p in found[name].parameters):
            _interface(kind, found[name], Parameter(switch, value=True))
    gc.unfreeze()
    return found


@contextmanager
def _running(kind: Callable[..., Node], overrides: Sequence[Parameter]) -> Iterator[Node]:
    begun = not rclpy.ok()  # tests may have begun it already
    if begun:
        rclpy.init()
    try:
        node = kind(parameter_overrides=list(overrides))
        yield node
        node.destroy_node()
    finally:
        if begun:
            rclpy.shutdown()
    # A participant of DDS lives as long as its node, which is in reference cycles. Fast DDS can
    # wait forever when one participant ends while others of the process discover it.
    del node
    gc.collect()


def _interface(
    kind: Callable[..., Node], found: Interface | None = None, *overrides: Parameter
) -> Interface:
    """Return the interface of a node, added to its interface with other parameters."""
    first = found is None
    found = found or Interface()
    with _running(kind, overrides) as node:
        for publisher in node.publishers:
            _add(found.published, publisher.topic_name, publisher.msg_type, publisher.qos_profile)
        for subscription in node.subscriptions:
            name = subscription.topic_name
            _add(found.subscribed, name, subscription.msg_type, subscription.qos_profile)
        for service in node.services:
            if not service.srv_type.__module__.startswith(COMMON_PACKAGES):
                _add(found.services, service.srv_name, service.srv_type)
        for name, kinds in get_action_server_names_and_types_by_node(node, node.get_name(), '/'):
            types = [kind.replace('/action', '') for kind in kinds]
            found.actions[name.lstrip('/')] = Entity(types)
        if first:
            found.parameters = list(_parameters(node))
    return found


def _add(
    entities: dict[str, Entity], name: str, kind: type, profile: QoSProfile | None = None
) -> None:
    """Add an entity; one name may have several types and qualities of service."""
    if name in COMMON_TOPICS or name.endswith('/transition_event'):
        return
    entity = entities.setdefault(name.lstrip('/'), Entity())
    full = f'{kind.__module__.split(".")[0]}/{kind.__name__}'
    if full not in entity.types:
        entity.types.append(full)
    if profile is not None and (words := qos_words(profile)) not in entity.qos:
        entity.qos.append(words)


def qos_words(profile: QoSProfile) -> str:
    """Return reliability, durability and depth of a quality of service in words."""
    reliability = profile.reliability.name.lower().replace('_', '-')
    durability = profile.durability.name.lower().replace('_', ' ')
    whole = profile.history == HistoryPolicy.KEEP_ALL
    return f'{reliability}, {durability}, {"all" if whole else profile.depth}'


def _parameters(node: Node) -> Iterator[Declared]:
    """Yield the parameters in the order of declaration."""
    for name, parameter in node.get_parameters_by_prefix('').items():
        if name in COMMON_PARAMETERS or name.startswith('qos_overrides'):
            continue
        descriptor = node.describe_parameter(name)
        bounds = [*descriptor.floating_point_range, *descriptor.integer_range]
        reach = ', '.join(f'{b.from_value:g} to {b.to_value:g}' for b in bounds)
        if descriptor.additional_constraints:
            when = 'unconfigured'
        else:
            when = 'at start' if descriptor.read_only else 'any time'
        yield Declared(name, parameter.value, descriptor.description, reach, when)
