# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Convex objects: shape, pose and optional mass, centre of mass and friction."""

from __future__ import annotations

import cmath
from dataclasses import dataclass, field
import math
from typing import NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.model.pose import MAX_MASS, Pose
from isotruss_ros.core.model.shapes import Disc, Shape, SurfacePoints
from isotruss_ros.core.model.units import likely_unit
from isotruss_ros.core.numerics.arrays import Array, finite_array, MAX_MAGNITUDE, Points
from isotruss_ros.core.numerics.tolerances import COINCIDENCE
import numpy as np
from numpy.typing import ArrayLike

ORIGIN = Pose(0.0, 0.0, 0.0)
#: Assumed coefficient of friction between a tube and an object without a value of its own [-].
DEFAULT_FRICTION = 0.5


@dataclass(frozen=True)
class ConvexObject:
    """
    A convex object at a pose in the robot frame.

    :ivar shape: a `Disc`, `Polygon` or `Ellipse`, in the object's frame.
    :ivar pose: pose of the object's frame in the robot frame (x, y, angle) [m, rad].
    :ivar mass: None where it is not known [kg].
    :ivar center_of_mass: (x, y) in the object's frame; the centroid of the area if None [m].
    :ivar friction: coefficient between this object and the tubes; None: that of the grasp [-].
    :ivar center: the origin of the object's frame in the robot frame, x + iy [m].
    :ivar turn: direction of the object's x axis in the robot frame, cos + i sin.
    :ivar middle: centroid of the area in the robot frame, x + iy, inside the object [m].
    :ivar arm: characteristic radius, half the mean width; turns moments into forces [m].
    :raises GraspError: a number is not usable.
    """

    shape: Shape
    pose: Pose = ORIGIN
    mass: float | None = None
    center_of_mass: tuple[float, float] | None = None
    friction: float | None = None
    center: complex = field(init=False, repr=False, compare=False)
    turn: complex = field(init=False, repr=False, compare=False)
    middle: complex = field(init=False, repr=False, compare=False)
    arm: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not callable(getattr(self.shape, 'nearest', None)):
            raise GraspError(f'shape {self.shape!r}: must be a Disc, a Polygon or an Ellipse')
        self._put(self.pose)
        object.__setattr__(self, 'arm', self.shape.perimeter / (2.0 * math.pi))
        if self.mass is not None:
            (mass,) = finite_array([self.mass], 1, "the object's mass [kg]", GraspError)
            if mass <= 0.0:
                raise GraspError(f"the object's mass {self.mass!r} kg: must be positive")
            if mass > MAX_MASS:
                hint = likely_unit(float(mass), 'kg', 0.0, MAX_MASS)
                raise GraspError(
                    f"the object's mass {mass:g} kg: must be at most {MAX_MASS:g} kg{hint}"
                )
            object.__setattr__(self, 'mass', float(mass))
        if self.center_of_mass is not None:
            x, y = finite_array(
                self.center_of_mass, 2, 'center_of_mass (x, y) in the object [m]', GraspError
            )
            away = max(abs(x), abs(y)) > MAX_MAGNITUDE  # squares of more may overflow
            if away or self.shape.nearest(np.array([complex(x, y)])).gaps[0] > 0.0:
                raise GraspError(f'center_of_mass ({x:g}, {y:g}) m: must be within the object')
            object.__setattr__(self, 'center_of_mass', (float(x), float(y)))
        if self.friction is not None:
            (friction,) = finite_array([self.friction], 1, "the object's friction", GraspError)
            if friction < 0.0:
                raise GraspError(f"the object's friction {self.friction!r}: must not be negative")
            object.__setattr__(self, 'friction', float(friction))

    @classmethod
    def disc(
        cls, center: tuple[float, float], diameter: float, friction: float | None = None
    ) -> ConvexObject:
        """
        Return an object with a circular cross-section: a cylinder at angle 0.

        :param center: (x, y) in the robot frame [m].
        :param diameter: diameter d of the object [m].
        :param friction: coefficient between it and the tubes; None: that of the grasp [-].
        :raises GraspError: a number is not usable.
        """
        x, y = finite_array(center, 2, "the object's centre [m]", GraspError)
        return cls(Disc(diameter), Pose(float(x), float(y), 0.0), friction=friction)

    def friction_or(self, given: float | None) -> float:
        """
        Return the coefficient of friction: the given one, the object's own or the default.

        :param given: coefficient of the grasp; None: the object's, or `DEFAULT_FRICTION` [-].
        """
        if given is not None:
            return given
        return DEFAULT_FRICTION if self.friction is None else self.friction

    def moved_to(self, pose: ArrayLike) -> ConvexObject:
        """
        Return the object at another pose.

        :param pose: pose of its frame in the robot frame (x, y, angle) [m, rad].
        :raises GraspError: the pose is not three finite numbers within range.
        """
        moved = object.__new__(ConvexObject)
        # What has been checked need not be checked again.
        moved.__dict__.update(self.__dict__)
        moved._put(pose)
        return moved

    def smoothed(self, length: float) -> ConvexObject:
        """
        Return the object with the smooth outline that its corners sample, see `Shape.smoothed`.

        :param length: length of the shortest face that is no such sample [m].
        """
        shape = self.shape.smoothed(length)
        if shape is self.shape:
            return self
        found = object.__new__(ConvexObject)
        arm = shape.perimeter / (2.0 * math.pi)
        # What has been checked need not be checked again.
        found.__dict__.update(self.__dict__, shape=shape, arm=arm)
        found._put(self.pose)
        return found

    def _put(self, pose: ArrayLike) -> None:
        """Set the pose and the quantities derived from it."""
        try:
            x, y, angle = map(float, pose)
            fits = all(-MAX_MAGNITUDE <= number <= MAX_MAGNITUDE for number in pose)
            fits = fits and not {bool, np.bool_}.issuperset(map(type, pose))
        except (TypeError, ValueError):
            fits = False
        if not fits:
            finite_array(pose, 3, "the object's pose (x, y, angle) [m, rad]", GraspError)
            raise GraspError(f"the object's pose {pose!r}: must be within {MAX_MAGNITUDE:g} m")
        center, turn = complex(x, y), cmath.rect(1.0, angle)
        middle = center + turn * self.shape.centroid
        self.__dict__.update(pose=Pose(x, y, angle), center=center, turn=turn, middle=middle)

    def support(self, normals: Points) -> Array:
        """
        Return the support function of the object about its frame's origin, (c,) [m].

        :param normals: (c,) outward unit normals of the tangents in the robot frame, x + iy.
        """
        return self.shape.support(normals * self.turn.conjugate())

    def nearest(self, points: Points) -> SurfacePoints:
        """
        Return the nearest points of the surface, with normals in the robot frame.

        :param points: (c,) x + iy in the robot frame, outside or inside [m].
        """
        found = self.shape.nearest((points - self.center) * self.turn.conjugate())
        return found._replace(normals=found.normals * self.turn)

    def outline(self, spacing: float = 0.005) -> Points:
        """
        Return points along the surface, counter-clockwise in the robot frame, (k,) x + iy [m].

        :param spacing: largest distance of the points where the surface is curved [m].
        """
        return self.center + self.turn * self.shape.outline(spacing)


class SegmentGaps(NamedTuple):
    """Gaps between an object and line segments; arrays over segments."""

    gaps: Array  #: (k,) distance from the surface, negative where the line penetrates it [m]
    normals: Points  #: (k,) unit vectors out of the object toward the segments, robot frame
    shares: Array  #: (k,) position of the nearest point along the segment, 0 to 1


def segment_gaps(body: ConvexObject, starts: Points, ends: Points) -> SegmentGaps:
    """
    Return the gaps between an object and line segments, with their directions.

    The direction points from the object's centroid to the line of the segment.

    :param body: the object in its place.
    :param starts: (k,) where the segments begin, robot frame [m].
    :param ends: (k,) where they end, perhaps where they begin [m].
    """
    spans = ends - starts
    lengths = np.abs(spans)
    some = lengths > COINCIDENCE
    axes = np.where(some, spans, 1.0) / np.where(some, lengths, 1.0)
    away = axes.conj() * (body.middle - starts)
    normals = -1j * np.where(away.imag < 0.0, -axes, axes)
    turn = body.turn
    points = body.center + turn * body.shape.support_points(normals * turn.conjugate())
    gaps = ((starts - points) * normals.conj()).real
    shares = (axes.conj() * (points - starts)).real / np.maximum(lengths, COINCIDENCE)
    beside = np.flatnonzero((shares < 0.0) | (shares > 1.0) | ~some)
    if len(beside):
        first = shares[beside] < 0.0
        found = body.nearest(np.where(first, starts[beside], ends[beside]))
        gaps[beside], normals[beside] = found.gaps, found.normals
        shares[beside] = np.where(first, 0.0, 1.0)
    return SegmentGaps(gaps, normals, shares)
