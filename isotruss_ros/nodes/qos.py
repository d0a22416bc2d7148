"""
Quality of service of each topic.

State and twists are worth something only while they are new: subscribers take the newest and do
not ask for it again, and so match reliable and best-effort publishers alike. What we publish, and
the commands that the simulator takes, is reliable, as ros2_control's controllers have it. None of
it is kept for late joiners: the next one comes with the next cycle, and an old one would be a lie
once the node is inactive.

What is said once and holds until it is said otherwise is latched.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy


def _last(
    depth: int,
    reliability: ReliabilityPolicy = ReliabilityPolicy.RELIABLE,
    durability: DurabilityPolicy = DurabilityPolicy.VOLATILE,
) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=reliability,
        durability=durability,
    )


#: For `subscribe_newest`, which says why it is not 1.
NEWEST = _last(20, ReliabilityPolicy.BEST_EFFORT)
RELIABLE = _last(1)
#: What tools that show `/diagnostics` expect.
DIAGNOSTICS = _last(10)

# Where the last message holds.
_KEPT = _last(100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_ANY = _last(100, ReliabilityPolicy.BEST_EFFORT)
#: Where every message counts. Of reliable publishers all are kept, up to the 5000 of Fast DDS;
#: then they wait, and where they do not, we hear of the loss. A best-effort queue that is full
#: drops messages without a word, so its depth has to be known, and more than it ever holds.
EVERY = (
    QoSProfile(
        history=HistoryPolicy.KEEP_ALL,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    ),
    _last(1000, ReliabilityPolicy.BEST_EFFORT),
)


def subscribe_latched(node: Node, kind: type, topic: str, callback: Callable[[Any], None]) -> None:
    """
    Hear every publisher of a topic, and from those that latch also what they said before.

    A subscription that asks for what was said before never matches a publisher that does not keep
    it, such as `ros2 topic pub` without options: a stop would go unheard. So there are two, and
    what a latching publisher says comes twice.
    """
    # One of the two not matching is as it should be: no warnings.
    quiet = SubscriptionEventCallbacks(use_default_callbacks=False)
    for profile in (_KEPT, _ANY):
        node.create_subscription(kind, topic, callback, profile, event_callbacks=quiet)
