"""The frame that wrenches are about, as tf2 gets it."""

from types import SimpleNamespace

from isotruss_ros.nodes.components import object_frame
from isotruss_ros.nodes.components.object_frame import ObjectFrame
from rclpy.time import Time


class Node:
    """A node that keeps what it publishes, as there are no wheels of tf2_msgs."""

    def __init__(self):
        self.published, self.logged = [], []

    def get_logger(self):
        return SimpleNamespace(info=self.logged.append)

    def create_lifecycle_publisher(self, kind, topic, _qos):
        return SimpleNamespace(publish=lambda message: self.published.append((topic, message)))


def test_the_frame_is_at_the_object_and_parallel_to_the_robot(monkeypatch):
    monkeypatch.setattr(object_frame, 'TFMessage', SimpleNamespace)
    node = Node()
    ObjectFrame(node, 'truss').broadcast((0.7, 0.4), Time(nanoseconds=1_500_000_000))
    ((topic, message),) = node.published
    assert topic == '/tf'
    (stamped,) = message.transforms
    assert (stamped.header.frame_id, stamped.child_frame_id) == ('truss', 'truss_object')
    assert (stamped.header.stamp.sec, stamped.header.stamp.nanosec) == (1, 500_000_000)
    moved, turned = stamped.transform.translation, stamped.transform.rotation
    assert (moved.x, moved.y, moved.z) == (0.7, 0.4, 0.0)
    assert (turned.x, turned.y, turned.z, turned.w) == (0.0, 0.0, 0.0, 1.0)
    assert not node.logged


def test_without_tf2_the_log_says_so(monkeypatch):
    monkeypatch.setattr(object_frame, 'TFMessage', None)
    node = Node()
    ObjectFrame(node, 'truss').broadcast((0.7, 0.4), Time())
    assert not node.published
    (words,) = node.logged
    assert 'tf2_msgs is not installed' in words
