# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The frames of object and modules, as tf2 gets them."""

import math
from types import SimpleNamespace

from isotruss_ros.core import ConvexObject, load_robot, Pose, settle_grasp, tangent_center
from isotruss_ros.nodes.conversions.grasp_messages import to_contact_wrench
from isotruss_ros.nodes.framework import transforms
from isotruss_ros.nodes.framework.transforms import find_contact_frames, TransformBroadcaster
import numpy as np
import pytest

ROBOT = load_robot('nine_member')


class Node:
    """A node that stores its messages, as there are no wheels of tf2_msgs."""

    def __init__(self):
        self.published, self.logged = [], []

    def get_logger(self):
        return SimpleNamespace(info=self.logged.append)

    def advertise(self, kind, topic, _qos):
        return SimpleNamespace(publish=lambda message: self.published.append((topic, message)))


def broadcast(node, config=ROBOT.home, contacts=None):
    """Broadcast once."""
    pose = Pose(0.7, 0.4, 0.3)
    TransformBroadcaster(node, ROBOT).broadcast(config, pose, contacts or {}, 1.5)


def angle_of(stamped):
    """Return by how much a frame is turned [rad]."""
    turned = stamped.transform.rotation
    assert (turned.x, turned.y) == (0.0, 0.0)
    return 2.0 * math.atan2(turned.z, turned.w)


def test_the_frames_of_the_object_are_at_its_centre_one_turned_and_one_aligned(monkeypatch):
    monkeypatch.setattr(transforms, 'TFMessage', SimpleNamespace)
    node = Node()
    broadcast(node)
    ((topic, message),) = node.published
    assert topic == '/tf'
    names = [('truss_object', 0.3), ('truss_object_aligned', 0.0)]
    for stamped, (name, angle) in zip(message.transforms[:2], names, strict=True):
        assert (stamped.header.frame_id, stamped.child_frame_id) == ('truss', name)
        assert (stamped.header.stamp.sec, stamped.header.stamp.nanosec) == (1, 500_000_000)
        moved = stamped.transform.translation
        assert (moved.x, moved.y, moved.z) == (0.7, 0.4, 0.0)
        assert angle_of(stamped) == pytest.approx(angle)
    assert not node.logged


def test_the_frame_of_a_contact_points_into_the_object(monkeypatch):
    monkeypatch.setattr(transforms, 'TFMessage', SimpleNamespace)
    node = Node()
    body = ConvexObject.disc(tangent_center(ROBOT.home, 'north/Z', 0.29), 0.3)
    contacts = find_contact_frames(settle_grasp(ROBOT.home, body).equilibrium)
    first, _ = contacts
    broadcast(node, contacts=contacts)
    ((_, message),) = node.published
    result = {each.child_frame_id: each for each in message.transforms}
    stamped = result[f'truss_{first.replace("/", "_")}_contact']
    moved, angle = stamped.transform.translation, angle_of(stamped)
    way = body.center - complex(moved.x, moved.y)
    assert abs(way) == pytest.approx(0.15, abs=2e-3)
    assert np.angle(way * np.exp(-1j * angle)) == pytest.approx(0.0, abs=1e-2)


def test_frames_of_modules_are_at_their_joints_with_the_rod_ahead(monkeypatch):
    monkeypatch.setattr(transforms, 'TFMessage', SimpleNamespace)
    node, config = Node(), ROBOT.configuration([0.03, -0.02, 0.05, 0.01, -0.04, 0.02])
    broadcast(node, config)
    ((_, message),) = node.published
    nodes = dict(zip(ROBOT.node_names, config.nodes, strict=True))
    assert len(message.transforms) == 2 + len(ROBOT.module_names)
    for name, stamped in zip(ROBOT.module_names, message.transforms[2:], strict=True):
        assert stamped.child_frame_id == f'truss_{name.replace("/", "_")}'
        joint = nodes[name.split('/')[1]]
        rod = 0.5 * (nodes[f'{name}/B'] + nodes[f'{name}/C']) - joint
        moved, turned = stamped.transform.translation, stamped.transform.rotation
        assert (moved.x, moved.y) == pytest.approx(joint)
        angle = 2.0 * math.atan2(turned.z, turned.w)
        assert [np.cos(angle), np.sin(angle)] == pytest.approx(rod / np.linalg.norm(rod))


def test_contact_forces_in_the_contact_frames_balance_the_external_wrench():
    body = ConvexObject.disc(tangent_center(ROBOT.home, 'north/Z', 0.29), 0.3)
    load = 0.5 - 1.0j
    settled = settle_grasp(ROBOT.home, body, 0.9, (load.real, load.imag, 0.0))
    total = load
    for member, (_, axis) in find_contact_frames(settled.equilibrium).items():
        normal, friction = settled.normal_forces[member], settled.friction_forces[member]
        force = to_contact_wrench('truss', member, 0.0, normal, friction).wrench.force
        total += complex(force.x, force.y) * axis
    assert abs(total) < 1e-6
