# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Several objects at their poses, whose quantities are arrays with the objects as first axis."""

from __future__ import annotations

from collections.abc import Sequence
import copy
from functools import cached_property
from typing import Any

from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.scaled_shape import ScaledShape
from isotruss_ros.core.model.shapes import Shape, SurfacePoints
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.samples import SampledValues
import numpy as np


def distinct_shapes(shapes: Sequence[Shape]) -> list[tuple[Shape, Array, Indices]]:
    """Return each shape that is not similar to another, with factors and objects (q,)."""
    numbers: dict[int, list[int]] = {}
    scaled = [
        (shape.base, shape.factor) if isinstance(shape, ScaledShape) else (shape, 1.0)
        for shape in shapes
    ]
    for i, (base, _) in enumerate(scaled):
        numbers.setdefault(id(base), []).append(i)
    factors = np.array([factor for _, factor in scaled])
    groups = map(np.array, numbers.values())
    return [(scaled[objects[0]][0], factors[objects], objects) for objects in groups]


class ShapeSamples:
    """Shapes of n objects; the arrays of `Shape` have one more axis, the first one."""

    def __init__(self, shapes: Sequence[Shape]) -> None:
        self._shapes = shapes
        self.centroid = np.array([shape.centroid for shape in shapes])

    @cached_property
    def distinct(self) -> list[tuple[Shape, Array, Indices]]:
        """Return the distinct shapes, see `distinct_shapes`."""
        return distinct_shapes(self._shapes)

    @property
    def is_round(self) -> bool:
        """Return whether all shapes are discs."""
        return all(shape.is_round for shape in self._shapes)

    @property
    def reach(self) -> Array:
        """Return the largest distances (n,) of points from the origin; see `Shape`."""
        return np.array([shape.reach for shape in self._shapes])

    def surface_at(self, corners: Indices, normals: Points) -> tuple[Points, Array]:
        """Return points (n, k) and radii of curvature at given normals; see `Shape`."""
        if len(normals) == 1:
            at, curved = self._shapes[0].surface_at(corners, normals[0])
            return at[None], curved[None]
        points, radii = np.empty(normals.shape, dtype=complex), np.empty(normals.shape)
        for shape, factors, objects in self.distinct:
            of_shape, scales = normals[objects], factors[:, None]
            every_corner = np.broadcast_to(corners, of_shape.shape).ravel()
            at, curved = shape.surface_at(every_corner, of_shape.ravel())
            points[objects] = scales * at.reshape(of_shape.shape)
            radii[objects] = scales * curved.reshape(of_shape.shape)
        return points, radii

    def support_points(self, normals: Points) -> Points:
        """Return the points (n, c) where tangents touch; see `Shape`."""
        points = np.empty(normals.shape, dtype=complex)
        for shape, factors, objects in self.distinct:
            of_shape = normals[objects]
            at = shape.support_points(of_shape.ravel()).reshape(of_shape.shape)
            points[objects] = factors[:, None] * at
        return points

    def nearest(self, points: Points, owners: Indices) -> SurfacePoints:
        """Return the nearest points of the objects `owners` (q,); see `Shape`."""
        gaps, normals = np.empty(len(points)), np.empty(len(points), dtype=complex)
        numbers, factors = np.empty(len(self._shapes), dtype=int), np.empty(len(self._shapes))
        for number, (_, of_shape, objects) in enumerate(self.distinct):
            numbers[objects], factors[objects] = number, of_shape
        of_points, scales = numbers[owners], factors[owners]
        for number in np.unique(of_points).tolist():
            chosen = of_points == number
            shape, of_chosen = self.distinct[number][0], scales[chosen]
            gaps[chosen], normals[chosen] = shape.nearest(points[chosen] / of_chosen)
            gaps[chosen] *= of_chosen
        return SurfacePoints(gaps, normals)

    def unroll(self, angles: Array, corners: Indices) -> Array:
        """Return arc lengths (n, k) to points with given normals; see `Shape`."""
        lengths = np.empty(angles.shape)
        for shape, factors, objects in self.distinct:
            of_shape = angles[objects]
            every_corner = np.broadcast_to(corners, of_shape.shape).ravel()
            unrolled = shape.unroll(of_shape.ravel(), every_corner)
            lengths[objects] = factors[:, None] * unrolled.reshape(of_shape.shape)
        return lengths


class ObjectSamples(SampledValues):
    """Objects with the attributes of `ConvexObject` as arrays (n,)."""

    sampled = 'center', 'turn', 'middle', 'angle', 'arm'
    center: Any
    turn: Any
    middle: Any
    angle: Any
    arm: Any

    def __init__(self, objects: Sequence[ConvexObject]) -> None:
        super().__init__(objects)
        self._objects: Sequence[ConvexObject] | None = objects
        self._shaped = objects  # at any poses

    @cached_property
    def shape(self) -> ShapeSamples:
        """Return the shapes of the objects."""
        return ShapeSamples([body.shape for body in self.objects])

    def moved_to(self, poses: Array) -> ObjectSamples:
        """Return the objects at other poses (n, 3)."""
        moved = copy.copy(self)
        moved.center = poses[:, 0] + 1j * poses[:, 1]
        moved.turn = np.exp(1j * poses[:, 2])
        moved.middle = moved.center + moved.turn * self.shape.centroid
        moved.angle = np.remainder(poses[:, 2] + np.pi, 2.0 * np.pi) - np.pi
        moved._objects = None
        return moved

    @property
    def objects(self) -> Sequence[ConvexObject]:
        """Return the objects."""
        if self._objects is None:
            poses = np.stack([self.center.real, self.center.imag, self.angle], axis=-1).tolist()
            objects = zip(self._shaped, poses, strict=True)
            self._objects = [body.moved_to(pose) for body, pose in objects]
        return self._objects

    def nearest(self, points: Points, owners: Indices) -> SurfacePoints:
        """Return nearest points of the surfaces of the objects `owners` (q,); see `nearest`."""
        turn = self.turn[owners]
        gaps, normals = self.shape.nearest((points - self.center[owners]) * turn.conj(), owners)
        return SurfacePoints(gaps, normals * turn)

    def take_samples(self, index: Any) -> ConvexObject | ObjectSamples:
        """Return chosen objects, or one, see `samples.take`."""
        chosen = np.arange(len(self.center))[index]
        if chosen.ndim == 0:
            return self.objects[chosen]
        taken = self.chosen(chosen)
        taken.__dict__.pop('shape', None)
        taken._shaped = [self._shaped[i] for i in chosen.tolist()]
        if self._objects is not None:
            taken._objects = [self._objects[i] for i in chosen.tolist()]
        return taken
