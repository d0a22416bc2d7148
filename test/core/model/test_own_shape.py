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
    RollingGrip,
    solve_twist,
)
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.model import object_file
from isotruss_ros.core.model.shapes import Shape
import numpy as np
import pytest

ROBOT = load_robot('nine_member')


@dataclass(frozen=True)
class Cam(Shape):
    """
    A circle beside the origin of the object's frame.

    :ivar radius: of the circle [m].
    :ivar offset: from the origin to its centre along x [m].
    """

    radius: float
    offset: float = 0.0

    @property
    def perimeter(self):
        """Return the length of the outline [m]."""
        return 2.0 * np.pi * self.radius

    @property
    def centroid(self):
        """Return the centroid [m]."""
        return complex(self.offset)

    @property
    def gyration(self):
        """Return the radius of gyration about the centroid [m]."""
        return self.radius / np.sqrt(2.0)

    @property
    def reach(self):
        """Return the largest distance of the surface from the origin [m]."""
        return self.radius + abs(self.offset)

    def support(self, normals):
        """Return the distance of tangents from the origin [m]."""
        return self.radius + self.offset * normals.real

    def surface_at(self, corners, normals):
        """Return points of the surface with given normals, and radii of curvature [m]."""
        return self.offset + self.radius * normals, np.full(len(normals), self.radius)

    def unroll(self, angles, corners):
        """Return the arcs to points with given normals [m]."""
        return self.radius * angles

    def outline(self, spacing):
        """Return points along the surface [m]."""
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
    found, wanted = solve_twist(ROBOT.home, cam, moved), solve_twist(ROBOT.home, disc, twist)
    assert found.status is wanted.status
    assert found.roller_velocities == pytest.approx(wanted.roller_velocities, abs=1e-12)


def test_a_circular_cam_rolls_like_a_disc():
    cam, disc = grips(0.4)
    rollers = solve_twist(ROBOT.home, disc, (0.01, 0.01, 0.5)).roller_velocities
    there = ROBOT.configuration(rollers)
    rolled, wanted = (RollingGrip.attach(ROBOT.home, grip).moved_to(there) for grip in (cam, disc))
    assert rolled.pose.angle == pytest.approx(wanted.pose.angle, abs=1e-9)
    assert rolled.grip.body.middle == pytest.approx(wanted.grip.center, abs=1e-9)


@pytest.mark.parametrize('shape', [CAM, Cam(0.2), Cam(0.1, -0.3)])
def test_the_cam_keeps_the_contract_of_shapes(shape):
    check_shape(shape, np.random.default_rng(1))


#: Faults of a cam, as methods in place of its own.
FAULTS = {
    'unroll': lambda self, angles, corners: 1.01 * self.radius * angles,
    'surface_at': lambda self, corners, normals: (
        self.offset + self.radius * normals,
        np.full(len(normals), 1.01 * self.radius),
    ),
    'support_points': lambda self, normals: self.offset + 1.01 * self.radius * normals,
    'centroid': property(lambda self: 0j),
    'gyration': property(lambda self: self.radius),
    'reach': property(lambda self: self.radius),
}


@pytest.mark.parametrize('name', FAULTS)
def test_a_faulty_cam_fails_the_contract(name):
    faulty = type('FaultyCam', (Cam,), {name: FAULTS[name]})
    with pytest.raises(AssertionError):
        check_shape(faulty(0.15, 0.05), np.random.default_rng(1))


def test_one_line_lets_object_files_have_the_shape(monkeypatch):
    monkeypatch.setitem(object_file.SHAPES, 'cam', Cam)
    assert read_object('{shape: cam, radius: 0.15, offset: 0.05}').shape == CAM
    assert read_object('{shape: cam, radius: 0.15, mass: 2.0}').mass == 2.0
