# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The frames of object and modules, as tf2 gets them."""

from functools import partial
import math
from operator import setitem
from types import SimpleNamespace

from isotruss_ros.core import ConvexObject, load_robot, Pose, settle_grasp, tangent_center
from isotruss_ros.nodes.conversions.grasp_messages import to_contact_wrench
from isotruss_ros.nodes.conversions.messages import read_stamp
from isotruss_ros.nodes.framework import transforms
from isotruss_ros.nodes.framework.transforms import find_contact_frames, TransformBroadcaster
import numpy as np
import pytest

ROBOT = load_robot('nine_member')


@pytest.fixture
def broadcast(monkeypatch):
    """Return a function that broadcasts once, and returns the transforms by name of the frame."""
    # There are no wheels of tf2_msgs.
    monkeypatch.setattr(transforms, 'TFMessage', SimpleNamespace)

    def run(config=ROBOT.home, contacts=None):
        published = {}
        node = SimpleNamespace(
            get_logger=lambda: None,
            advertise=lambda _, topic, __: SimpleNamespace(
                publish=partial(setitem, published, topic)
            ),
        )
        pose = Pose(0.7, 0.4, 0.3)
        TransformBroadcaster(node, ROBOT).broadcast(config, pose, contacts or {}, 1.5)
        assert [*published] == ['/tf']
        return {stamped.child_frame_id: stamped for stamped in published['/tf'].transforms}

    return run


def angle_of(stamped):
    """Return by how much a frame is turned [rad]."""
    turned = stamped.transform.rotation
    assert (turned.x, turned.y) == (0.0, 0.0)
    return 2.0 * math.atan2(turned.z, turned.w)


def test_the_frames_of_the_object_are_at_its_centre_one_turned_and_one_aligned(broadcast):
    frames = broadcast()
    for name, angle in (('truss_object', 0.3), ('truss_object_aligned', 0.0)):
        stamped = frames[name]
        assert stamped.header.frame_id == 'truss'
        assert read_stamp(stamped.header) == 1.5
        moved = stamped.transform.translation
        assert (moved.x, moved.y, moved.z) == (0.7, 0.4, 0.0)
        assert angle_of(stamped) == pytest.approx(angle)


def test_the_frame_of_a_contact_points_into_the_object(broadcast):
    body = ConvexObject.disc(tangent_center(ROBOT.home, 'north/Z', 0.29), 0.3)
    contacts = find_contact_frames(settle_grasp(ROBOT.home, body).equilibrium)
    first, _ = contacts
    stamped = broadcast(contacts=contacts)[f'truss_{first.replace("/", "_")}_contact']
    moved, angle = stamped.transform.translation, angle_of(stamped)
    way = body.center - complex(moved.x, moved.y)
    assert abs(way) == pytest.approx(0.15, abs=2e-3)
    assert np.angle(way * np.exp(-1j * angle)) == pytest.approx(0.0, abs=1e-2)


def test_frames_of_modules_are_at_their_joints_with_the_rod_ahead(broadcast):
    config = ROBOT.configuration([0.03, -0.02, 0.05, 0.01, -0.04, 0.02])
    frames = broadcast(config)
    nodes = dict(zip(ROBOT.node_names, config.nodes, strict=True))
    assert len(frames) == 2 + len(ROBOT.module_names)
    for name in ROBOT.module_names:
        stamped = frames[f'truss_{name.replace("/", "_")}']
        joint = nodes[name.split('/')[1]]
        rod = complex(*(0.5 * (nodes[f'{name}/B'] + nodes[f'{name}/C']) - joint))
        moved = stamped.transform.translation
        assert (moved.x, moved.y) == pytest.approx(joint)
        assert np.exp(1j * angle_of(stamped)) == pytest.approx(rod / abs(rod))


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
