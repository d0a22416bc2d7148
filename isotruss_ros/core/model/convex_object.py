# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Convex objects with shape and pose, and optionally mass, centre of mass and friction."""

from __future__ import annotations

import cmath
from collections.abc import Mapping
import copy
from dataclasses import dataclass, field
import math
from typing import Any, NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.model.pose import check_range, MAX_FRICTION, MAX_MASS, Pose, pose_fault
from isotruss_ros.core.model.scaled_shape import ScaledShape
from isotruss_ros.core.model.shapes import Disc, Shape, SurfacePoints
from isotruss_ros.core.numerics.argument_kinds import check_kind
from isotruss_ros.core.numerics.arrays import Array, finite_array, MAX_LOAD, MAX_MAGNITUDE, Points
from isotruss_ros.core.numerics.records import Record
from isotruss_ros.core.numerics.tolerances import COINCIDENCE, ROUNDING
import numpy as np
from numpy.typing import ArrayLike

ORIGIN = Pose(0.0, 0.0, 0.0)
#: Coefficient of friction between a tube and an object whose own coefficient is unknown [-].
DEFAULT_FRICTION = 0.5
#: External wrench of an object in error messages.
EXTERNAL_WRENCH = 'the external wrench (fx, fy [N], m [N m])'


@dataclass(frozen=True, repr=False)
class ConvexObject(Record, headline=('shape', 'pose', 'mass', 'center_of_mass', 'friction')):
    """
    Convex object at a pose in the robot frame.

    :ivar shape: a `Disc`, `Polygon` or `Ellipse`, in the object's frame.
    :ivar pose: pose of the object's frame in the robot frame (x, y, angle) [m, rad]. The angle is
        at most one turn in either direction; `moved_to` accepts more.
    :ivar mass: mass of the object [kg]; None if unknown.
    :ivar center_of_mass: centre of mass (x, y) in the object's frame [m]; None: the centroid of
        the area.
    :ivar friction: coefficient of friction between this object and the tubes [-]; None: the
        coefficient given for the grasp is used.
    :ivar uncertainty: standard deviations of parameters, see `Uncertainty`.
    :ivar center: origin of the object's frame in the robot frame, x + iy [m].
    :ivar turn: direction of the object's x axis in the robot frame, as cos + i sin of the angle.
    :ivar middle: centroid of the area in the robot frame, x + iy [m].
    :ivar arm: characteristic radius, half of the mean width [m]; moments are divided by it.
    :raises GraspError: a number is not finite or not within its range.
    """

    shape: Shape
    pose: Pose = ORIGIN
    mass: float | None = None
    center_of_mass: tuple[float, float] | None = None
    friction: float | None = None
    uncertainty: Mapping[str, Any] | None = field(default=None, compare=False, repr=False)
    center: complex = field(init=False, repr=False, compare=False)
    turn: complex = field(init=False, repr=False, compare=False)
    middle: complex = field(init=False, repr=False, compare=False)
    arm: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Check the fields, and set the derived quantities."""
        check_kind('shape', self.shape, 'Shape')
        self._place(self.pose)
        self._check_pose()
        if self.mass is not None:
            mass = check_range(self.mass, "the object's mass", 'kg', ROUNDING, MAX_MASS)
            object.__setattr__(self, 'mass', mass)
        if self.center_of_mass is not None:
            x, y = finite_array(
                self.center_of_mass, 2, 'center_of_mass (x, y) in the object [m]', GraspError
            )
            too_far = max(abs(x), abs(y)) > MAX_MAGNITUDE  # squares of larger values may overflow
            if too_far or self.shape.nearest(np.array([complex(x, y)])).gaps[0] > 0.0:
                raise GraspError(f'center_of_mass ({x:g}, {y:g}) m: must be within the object')
            object.__setattr__(self, 'center_of_mass', (float(x), float(y)))
        if self.friction is not None:
            friction = check_friction(self.friction, "the object's friction")
            object.__setattr__(self, 'friction', friction)

    def _check_pose(self) -> None:
        """Raise a `GraspError` if the pose is out of the range of poses from outside."""
        if fault := pose_fault(*self.pose):
            raise GraspError(f"the object's pose {tuple(self.pose)}: {fault}")

    def _place(self, pose: ArrayLike) -> None:
        """Set the pose, and the quantities that follow from shape and pose."""
        # Three floats, as in a control loop, need no conversion to an array.
        try:
            x, y, angle = pose
            numbers = (x, y, angle)
            is_valid = all(isinstance(n, float) and abs(n) <= MAX_MAGNITUDE for n in numbers)
        except (TypeError, ValueError):
            is_valid = False
        if not is_valid:
            what = "the object's pose (x, y, angle) [m, rad]"
            x, y, angle = finite_array(pose, 3, what, GraspError).tolist()
            if max(abs(x), abs(y), abs(angle)) > MAX_MAGNITUDE:
                raise GraspError(f"the object's pose {pose!r}: must be within {MAX_MAGNITUDE:g} m")
        center, turn = complex(x, y), cmath.rect(1.0, angle)
        object.__setattr__(self, 'pose', Pose(float(x), float(y), float(angle)))
        object.__setattr__(self, 'center', center)
        object.__setattr__(self, 'turn', turn)
        object.__setattr__(self, 'middle', center + turn * self.shape.centroid)
        object.__setattr__(self, 'arm', self.shape.perimeter / (2.0 * math.pi))

    @property
    def angle(self) -> float:
        """Return the angle of the object's frame [rad]."""
        return self.pose.angle

    @classmethod
    def disc(
        cls, center: tuple[float, float], diameter: float, friction: float | None = None
    ) -> ConvexObject:
        """
        Return a disc with a given centre, at angle 0.

        :param center: (x, y) in the robot frame [m].
        :param diameter: diameter d of the object [m].
        :param friction: coefficient of friction between object and tubes [-]; None: the
            coefficient given for the grasp is used.
        :raises GraspError: a number is not finite or not within its range.
        """
        x, y = finite_array(center, 2, "the object's centre [m]", GraspError)
        return cls(Disc(diameter), Pose(float(x), float(y), 0.0), friction=friction)

    def friction_or(self, given: float | None) -> float:
        """
        Return the given coefficient of friction, or the object's if none is given.

        :param given: coefficient for the grasp [-]; None: the object's coefficient, or
            `DEFAULT_FRICTION` if the object has none.
        """
        if given is not None:
            return given
        return DEFAULT_FRICTION if self.friction is None else self.friction

    def moved_to(self, pose: ArrayLike) -> ConvexObject:
        """
        Return the object at another pose.

        :param pose: pose (x, y, angle) of the object's frame in the robot frame [m, rad].
        :raises GraspError: the pose is not three finite numbers; see `placed_at` for their range.
        """
        moved = copy.copy(self)  # the other fields were checked when this object was created
        moved._place(pose)
        return moved

    def placed_at(self, pose: ArrayLike) -> ConvexObject:
        """
        Return the object at a pose from outside, whose range is checked as that of a new object.

        :param pose: pose (x, y, angle) of the object's frame in the robot frame [m, rad].
        :raises GraspError: the pose is not three finite numbers within range.
        """
        placed = self.moved_to(pose)
        placed._check_pose()
        return placed

    def smoothed(self, length: float) -> ConvexObject:
        """
        Return the object with the smooth curve that its outline approximates, if there is one.

        See `Shape.smoothed`.

        :param length: only faces shorter than this are regarded as chords of a smooth curve [m].
        """
        shape = self.shape.smoothed(length)
        if shape is self.shape:
            return self
        smooth = copy.copy(self)
        object.__setattr__(smooth, 'shape', shape)
        smooth._place(self.pose)
        return smooth

    def scaled(self, factor: float, interpolated: bool = False) -> ConvexObject:
        """
        Return the object enlarged by a factor about its centroid, see `ScaledShape`.

        :param factor: ratio of lengths to those of this object [-].
        :param interpolated: whether the depths of its dents are interpolated.
        """
        larger, shape = copy.copy(self), ScaledShape(self.shape, factor, interpolated)
        object.__setattr__(larger, 'shape', shape)
        moved = self.turn * self.shape.centroid * (1.0 - factor)
        larger._place(np.add(self.pose, (moved.real, moved.imag, 0.0)))
        return larger

    def support(self, normals: Points) -> Array:
        """
        Return the support function (c,) of the object about the origin of its frame [m].

        :param normals: (c,) outward unit normals of the tangents in the robot frame, x + iy.
        """
        return self.shape.support(normals * self.turn.conjugate())

    def nearest(self, points: Points) -> SurfacePoints:
        """
        Return the points of the surface nearest to given points, with normals in the robot frame.

        :param points: (c,) points x + iy in the robot frame, outside or inside the object [m].
        """
        nearest = self.shape.nearest((points - self.center) * self.turn.conjugate())
        return nearest._replace(normals=nearest.normals * self.turn)

    def outline(self, spacing: float = 0.005) -> Points:
        """
        Return points (k,) along the surface, counter-clockwise, x + iy in the robot frame [m].

        :param spacing: largest distance of successive points where the surface is curved [m].
        """
        return self.center + self.turn * self.shape.outline(spacing)


def check_friction(value: float, what: str = 'friction') -> float:
    """Return a checked coefficient of friction [-]."""
    return check_range(value, what, '', 0.0, MAX_FRICTION)


def check_load(
    body: ConvexObject, friction: float | None, external_wrench: ArrayLike
) -> tuple[float, Array]:
    """Return the checked coefficient of friction of a grasp, and the external wrench (3,)."""
    coefficient = check_friction(body.friction_or(friction))
    return coefficient, finite_array(external_wrench, 3, EXTERNAL_WRENCH, GraspError, MAX_LOAD)


class SegmentGaps(NamedTuple):
    """Gaps between an object and k line segments."""

    gaps: Array  #: (k,) distances from the surface, negative if the segment penetrates it [m]
    normals: Points  #: (k,) unit vectors from the object toward the segments, robot frame
    #: (k,) position of the nearest point along each segment, 0 at its start to 1 at its end
    shares: Array


def facing_normals(middle: complex | Points, points: Points, axes: Points) -> Points:
    """Return the unit normals (k,) of lines through `points`, directed away from `middle`."""
    middle_is_right = (axes.conj() * (middle - points)).imag < 0.0
    return -1j * np.where(middle_is_right, -axes, axes)


def segment_gaps(body: ConvexObject, starts: Points, ends: Points) -> SegmentGaps:
    """
    Return the gaps between an object and line segments, with the directions of the gaps.

    Of several `ObjectSamples`, segments and gaps have the objects as their first axis.
    A normal is perpendicular to its segment and points away from the object's centroid. If the
    nearest point is an end of the segment, the normal is that of the object's surface.
    """
    # Unit vectors along the segments.
    spans = ends - starts
    lengths = np.abs(spans)
    has_length = lengths > COINCIDENCE  # others have any axis
    axes = np.where(has_length, spans, 1.0) / np.where(has_length, lengths, 1.0)
    # Gaps to the infinite lines along the segments, and positions of the nearest points as shares
    # of the segments.
    middle, turn, center = (
        np.asarray(z)[..., None] for z in (body.middle, body.turn, body.center)
    )
    normals = facing_normals(middle, starts, axes)
    support_points = body.shape.support_points(normals * turn.conj())
    points = center + turn * support_points
    gaps = ((starts - points) * normals.conj()).real
    shares = (axes.conj() * (points - starts)).real / np.maximum(lengths, COINCIDENCE)
    # A line that crosses the object may do so beyond its segment.
    crossing = np.nonzero((gaps < 0.0) & has_length)
    depths, across = gaps[crossing], normals[crossing]
    # Where the nearest point of the line is beyond an end of the segment, this end is nearest.
    beyond = np.nonzero((shares < 0.0) | (shares > 1.0) | ~has_length)
    if not (beyond[0].size or crossing[0].size):
        return SegmentGaps(gaps, normals, shares)
    before_start = shares[beyond] < 0.0
    nearer_ends = np.where(before_start, starts[beyond], ends[beyond])
    points = np.concatenate([nearer_ends, starts[crossing], ends[crossing]])
    owners = (
        np.concatenate([of, of_line, of_line])
        for of, of_line in zip(beyond[:-1], crossing[:-1], strict=True)
    )
    nearest = body.nearest(points, *owners)
    first = beyond[0].size
    gaps[beyond], normals[beyond] = nearest.gaps[:first], nearest.normals[:first]
    shares[beyond] = np.where(before_start, 0.0, 1.0)
    if crossing[0].size:
        # An end is nearest if the distance grows from there on; else the segment is in the object.
        is_outside = gaps[crossing] > 0.0
        gaps[crossing] = np.where(is_outside, depths, gaps[crossing])
        normals[crossing] = np.where(is_outside, across, normals[crossing])
        at_ends = (part.reshape(2, -1) for part in (nearest.gaps[first:], nearest.normals[first:]))
        for share, (end_gaps, end_normals, inward) in enumerate(
            zip(*at_ends, (axes, -axes), strict=True)
        ):
            slopes = (end_normals * inward[crossing].conj()).real
            chosen = (end_gaps > 0.0) & (slopes >= 0.0)
            segments = tuple(index[chosen] for index in crossing)
            gaps[segments], normals[segments] = end_gaps[chosen], end_normals[chosen]
            shares[segments] = share
    return SegmentGaps(gaps, normals, shares)
