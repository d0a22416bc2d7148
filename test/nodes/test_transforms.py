# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The frames of object and modules, as tf2 gets them."""

import math
from types import SimpleNamespace

from isotruss_ros.core import load_robot
from isotruss_ros.nodes.framework import transforms
from isotruss_ros.nodes.framework.transforms import TransformBroadcaster
import numpy as np
import pytest

ROBOT = load_robot('nine_member')


class Node:
    """A node that keeps what it publishes, as there are no wheels of tf2_msgs."""

    def __init__(self):
        self.published, self.logged = [], []

    def get_logger(self):
        return SimpleNamespace(info=self.logged.append)

    def create_lifecycle_publisher(self, kind, topic, _qos):
        return SimpleNamespace(publish=lambda message: self.published.append((topic, message)))


def broadcast(node, config=ROBOT.home):
    """Broadcast once."""
    TransformBroadcaster(node, ROBOT).broadcast(config, (0.7, 0.4), 1.5)


def test_the_frame_of_the_object_is_at_its_centre_and_parallel_to_the_robot(monkeypatch):
    monkeypatch.setattr(transforms, 'TFMessage', SimpleNamespace)
    node = Node()
    broadcast(node)
    ((topic, message),) = node.published
    assert topic == '/tf'
    stamped = message.transforms[0]
    assert (stamped.header.frame_id, stamped.child_frame_id) == ('truss', 'truss_object')
    assert (stamped.header.stamp.sec, stamped.header.stamp.nanosec) == (1, 500_000_000)
    moved, turned = stamped.transform.translation, stamped.transform.rotation
    assert (moved.x, moved.y, moved.z) == (0.7, 0.4, 0.0)
    assert (turned.x, turned.y, turned.z, turned.w) == (0.0, 0.0, 0.0, 1.0)
    assert not node.logged


def test_frames_of_modules_are_at_their_joints_with_the_rod_ahead(monkeypatch):
    monkeypatch.setattr(transforms, 'TFMessage', SimpleNamespace)
    node, config = Node(), ROBOT.configuration([0.03, -0.02, 0.05, 0.01, -0.04, 0.02])
    broadcast(node, config)
    ((_, message),) = node.published
    nodes = dict(zip(ROBOT.node_names, config.nodes, strict=True))
    assert len(message.transforms) == 1 + len(ROBOT.module_names)
    for name, stamped in zip(ROBOT.module_names, message.transforms[1:], strict=True):
        assert stamped.child_frame_id == f'truss_{name.replace("/", "_")}'
        joint = nodes[name.split('/')[1]]
        rod = 0.5 * (nodes[f'{name}/B'] + nodes[f'{name}/C']) - joint
        moved, turned = stamped.transform.translation, stamped.transform.rotation
        assert (moved.x, moved.y) == pytest.approx(joint)
        angle = 2.0 * math.atan2(turned.z, turned.w)
        assert [np.cos(angle), np.sin(angle)] == pytest.approx(rod / np.linalg.norm(rod))


def test_without_tf2_the_log_says_so(monkeypatch):
    monkeypatch.setattr(transforms, 'TFMessage', None)
    node = Node()
    broadcast(node)
    assert not node.published
    (words,) = node.logged
    assert 'tf2_msgs is not installed' in words
