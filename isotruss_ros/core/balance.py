"""
What friction cannot balance in a grip, and how pressing its sides harder or less changes that.

Two places of contact: the wrenches that friction can bring about lie in a plane, next to flat, so
what matters is the load across it. Three: the resultant force of all.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.grasp_analysis import Cylinder, GraspAnalysis
from isotruss_ros.core.nearest import nearest_on_side
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class Imbalance(NamedTuple):
    """
    What friction cannot take, in s - 1 directions for s sides.

    :ivar load: (s - 1,) in these directions [N], moments over d/2.
    :ivar width: (s - 1,) what friction takes of it all the same, not negative [N].
    :ivar slope: (s - 1, s) derivatives of the load by the depths of the sides [N/m].
    """

    load: Array
    width: Array
    slope: Array


def imbalance(
    config: Configuration,
    cylinder: Cylinder,
    analysis: GraspAnalysis,
    external_wrench: ArrayLike,
    sides: Sequence[int],
    depths: Array,
    friction: float,
) -> Imbalance | None:
    """
    Return the load that friction cannot take, or None where a side does not press.

    :param external_wrench: (fx, fy, m) on the object [N, N m].
    :param sides: the s members that hold the object.
    :param depths: (s,) how deep each presses, positive [m].
    :param friction: coefficient.
    """
    layout, points = config.robot.layout, config.points
    pressing = [analysis.contact_forces.get(config.robot.member_names[i], 0.0) for i in sides]
    if min(pressing) <= 0.0:
        return None
    begin = points[layout.b[list(sides)]]
    along = points[layout.c[layout.following[list(sides)]]] - begin
    center = np.full(len(sides), complex(*cylinder.center))
    inward = nearest_on_side(center, begin, along).normal
    # As if each side were a spring of its own; the caller's secants learn the rest.
    stiffness = np.array(pressing) / depths
    model = np.stack([inward.real * stiffness, inward.imag * stiffness, np.zeros(len(sides))])

    touching = analysis.normal_forces > 0.0
    normals, forces = analysis.normals[touching], analysis.normal_forces[touching]
    wrench = np.asarray(external_wrench) / (1.0, 1.0, 0.5 * cylinder.diameter)
    load = wrench - np.append(forces @ normals, 0.0)
    if len(sides) > 2:
        return Imbalance(load[:2], np.zeros(2), model[:2])
    tangents = np.column_stack([-normals[:, 1], normals[:, 0], np.ones(len(forces))])
    segments = forces[:, None] * tangents
    across = np.linalg.svd(segments)[2][2]
    slope = across @ model
    turn = 1.0 if slope[0] >= slope[1] else -1.0  # an axis has no sign: always the same one
    width = friction * np.abs(segments @ across).sum()
    return Imbalance(turn * np.array([across @ load]), np.array([width]), turn * slope[None])


def correction(found: Sequence[Imbalance]) -> Array:
    """
    Return by how much the load is to change so that friction takes it in every analysis, (s - 1,).

    The middle of what all of them leave room for, or, where they leave none, between them.
    """
    low = np.max([one.load - one.width for one in found], axis=0)
    high = np.min([one.load + one.width for one in found], axis=0)
    return -0.5 * (low + high)
