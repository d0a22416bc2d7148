"""
Quality of service of each topic.

State and twists count only while they are new: subscribers take the newest and request no
retransmission, and so match reliable and best-effort publishers alike. What the nodes publish, and
the commands that the simulator takes, is reliable, as ros2_control's controllers have it. None of
it is kept for late joiners: the next message comes with the next cycle, and an old one would be
wrong once the node is inactive.

What holds until the next message, however late that comes, is latched.
"""

from __future__ import annotations

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


#: For `subscribe_newest`, which explains why the depth is not 1.
NEWEST = _last(20, ReliabilityPolicy.BEST_EFFORT)
RELIABLE = _last(1)
#: What tools that show `/diagnostics` expect.
DIAGNOSTICS = _last(10)
#: For `subscribe_latched`: publishers that latch, and those that do not.
LATCHED = (
    _last(100, durability=DurabilityPolicy.TRANSIENT_LOCAL),
    _last(100, ReliabilityPolicy.BEST_EFFORT),
)
#: For `subscribe_every`. Of reliable publishers all messages are kept, up to the 5000 of Fast DDS;
#: then the publishers wait, and where they do not, an event reports the loss. A best-effort queue
#: that is full drops messages without an event, so its depth has to be known, and larger than it
#: is ever filled.
EVERY = (
    QoSProfile(
        history=HistoryPolicy.KEEP_ALL,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    ),
    _last(1000, ReliabilityPolicy.BEST_EFFORT),
)
