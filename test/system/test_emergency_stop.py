"""The emergency stop over DDS: what follows it, what was lost, and what came before the node."""

from isotruss_ros.core import Status
from isotruss_ros.nodes.framework.subscriptions import MAX_BATCH
from isotruss_ros.nodes.manipulation import Manipulation
from probe import overrides, world
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from robot_processes import robot
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

pytestmark = pytest.mark.system


def node(**values):
    """Return a manipulation node with parameters; the joint states here are made up."""
    return lambda: Manipulation(overrides(**({'failure_time': 0.0} | values)))


def release(w):
    """Call the service; return its answer."""
    client = w.probe.create_client(Trigger, 'release_emergency_stop')
    return w.call(client, Trigger.Request())


def until_heard_by_both(w, publisher):
    """Spin until both subscriptions of the node, or the one that matches, hear a publisher."""
    latched = publisher.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    w.until(lambda: publisher.get_subscription_count() == 1 + latched)


def burst(publisher, count):
    """Say true once, and then that often false, without a pause."""
    publisher.publish(Bool(data=True))
    for _ in range(count):
        publisher.publish(Bool(data=False))


LONG = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PLAIN = QoSProfile(depth=1000)
HASTY = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)


@pytest.mark.parametrize('profile', [LONG, PLAIN, HASTY], ids=['latched', 'reliable', 'hasty'])
def test_a_stop_counts_however_many_messages_follow(profile):
    """All of it is there before the node looks."""
    with world(node()) as w:
        publisher = w.probe.create_publisher(Bool, 'emergency_stop', profile)
        until_heard_by_both(w, publisher)
        w.until_code(Status.OK, w.probe.send_all)
        burst(publisher, 500)
        status = w.until_code(Status.HALT_EMERGENCY_STOP, w.probe.send_all)
        assert 'stopped by the topic' in status.message


def test_a_stop_counts_however_many_messages_follow_from_another_process(tmp_path):
    with robot(tmp_path) as r:
        r.start('simulator')
        r.start('manipulation')
        publisher = r.w.probe.create_publisher(Bool, 'emergency_stop', LONG)
        until_heard_by_both(r.w, publisher)
        for count in (1, 100, 101, 500):
            r.until_moving()
            burst(publisher, count)
            r.until(lambda: r.w.code() == Status.HALT_EMERGENCY_STOP)
            r.until(lambda: 'message is false' in r.w.probe.last('status').message)
            assert release(r.w).success


@pytest.mark.parametrize('profile', [LONG, HASTY], ids=['latched', 'hasty'])
def test_lost_messages_count_as_a_stop(profile):
    """Far more than is kept for the node while it does not look."""
    with world(node()) as w:
        publisher = w.probe.create_publisher(Bool, 'emergency_stop', profile)
        until_heard_by_both(w, publisher)
        w.until_code(Status.OK, w.probe.send_all)
        for _ in range(7000):
            publisher.publish(Bool(data=False))
        status = w.until_code(Status.HALT_EMERGENCY_STOP, w.probe.send_all)
        assert 'messages of emergency_stop were lost' in status.message
        assert 'release_emergency_stop' in status.message
        # Until all has come; there may be more to be told of.
        w.until(lambda: release(w).message == 'nothing was stopped', w.probe.send_all)
        w.until_code(Status.OK, w.probe.send_all)


def test_a_flood_takes_no_cycle_from_the_loop():
    """What waits is taken in parts, and the cycles come between them."""
    with world(node()) as w:
        publisher = w.probe.create_publisher(Bool, 'emergency_stop', LONG)
        until_heard_by_both(w, publisher)
        w.until_code(Status.OK, w.probe.send_all)
        parts = []
        take = w.nodes[1]._stop._receive
        for heard in w.nodes[1].subscriptions:
            if heard.topic_name == '/emergency_stop':
                heard.callback.__self__._callback = lambda messages: (
                    parts.append(len(messages)),
                    take(messages),
                )
        for _ in range(990):
            publisher.publish(Bool(data=False))
        w.until(lambda: sum(parts) == 2 * 990, w.probe.send_all)
        assert max(parts) <= MAX_BATCH < 500
        assert w.code() == Status.OK


def test_a_stop_from_before_the_node_came_up_counts():
    with world() as w:
        w.probe.stops.publish(Bool(data=True))
        w.add(node()())
        w.until_code(Status.HALT_EMERGENCY_STOP, w.probe.send_all)
