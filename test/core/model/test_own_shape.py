# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A shape of one's own: a cam, a circle beside the origin of its frame."""

from dataclasses import dataclass

from contracts import check_shape
from isotruss_ros.core import (
    ConvexObject,
    Disc,
    Grip,
    load_robot,
    place_between,
    read_object,
    solve_twist,
)
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.model import object_file
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.recording.encoded_values import decode, encode, RecordedCycleError
import numpy as np
import pytest

ROBOT = load_robot('nine_member')


@dataclass(frozen=True)
class Cam(Shape):
    """A circle with a radius [m] and an offset of its centre along x [m]."""

    radius: float
    offset: float = 0.0

    @property
    def perimeter(self):
        return 2.0 * np.pi * self.radius

    @property
    def centroid(self):
        return complex(self.offset)

    @property
    def gyration(self):
        return self.radius / np.sqrt(2.0)

    @property
    def reach(self):
        return self.radius + abs(self.offset)

    def support(self, normals):
        return self.radius + self.offset * normals.real

    def surface_at(self, corners, normals):
        return self.offset + self.radius * normals, np.full(len(normals), self.radius)

    def unroll(self, angles, corners):
        return self.radius * angles

    def outline(self, spacing):
        count = max(8, int(np.ceil(self.perimeter / spacing)))
        return self.offset + self.radius * np.exp(2j * np.pi * np.arange(count) / count)


CAM = Cam(0.15, 0.05)
MEMBERS = members_at(ROBOT, 'north/Z')


def grips(angle):
    """Return the grip of the cam, and that of the disc which is the same in space."""
    cam = place_between(ROBOT.home, MEMBERS, CAM, angle)
    middle = cam.body.middle
    return cam, Grip(MEMBERS, ConvexObject(Disc(0.3), (middle.real, middle.imag, angle)))


@pytest.mark.parametrize('angle', [-2.0, 0.0, 0.7])
def test_rollers_move_a_circular_cam_like_a_disc(angle):
    cam, disc = grips(angle)
    arm = cam.center - disc.center
    twist = np.array([0.01, -0.02, 0.1])
    moved = twist + 0.1 * np.array([-arm.imag, arm.real, 0.0])
    command, wanted = solve_twist(ROBOT.home, cam, moved), solve_twist(ROBOT.home, disc, twist)
    assert command.status is wanted.status
    assert command.roller_velocities == pytest.approx(wanted.roller_velocities, abs=1e-12)


@pytest.mark.parametrize('shape', [CAM, Cam(0.1, -0.3)])
def test_the_cam_keeps_the_contract_of_shapes(shape):
    check_shape(shape, np.random.default_rng(1))


def test_one_line_lets_object_files_have_the_shape(monkeypatch):
    monkeypatch.setitem(object_file.SHAPES, 'cam', Cam)
    assert read_object('{shape: cam, radius: 0.15, offset: 0.05}').shape == CAM


def test_a_record_of_a_cycle_contains_an_own_shape():
    grip, _ = grips(0.7)
    assert decode(encode(grip)) == grip


def test_values_without_named_fields_and_unknown_classes_are_refused():
    with pytest.raises(RecordedCycleError, match='object: must be a dataclass'):
        encode(object())
    with pytest.raises(RecordedCycleError, match="'Gear': no known class"):
        decode({'kind': 'Gear'})
