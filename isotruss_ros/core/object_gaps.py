"""How far an object is from members and modules, and how the rollers change that."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.clearance import bodies
from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.grasp_analysis import Cylinder
from isotruss_ros.core.nearest import nearest_on_side
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Points = NDArray[np.complex128]


class ObjectGaps(NamedTuple):
    """
    Distances between an object that stands still and the parts of a robot, m of each kind.

    :ivar members: (m,) between the skin of the straight tubes and the object's surface [m],
        negative where the tubes would have to give way.
    :ivar modules: (m,) between the discs of modules, see `clearance`, and that surface [m].
    :ivar openings: (m,) angle between the two sides that meet at each module [rad].
    :ivar by_rollers: (3m, r) derivatives of the three, in this order, by roller travel.
    """

    members: Array
    modules: Array
    openings: Array
    by_rollers: Array


def object_gaps(config: Configuration, cylinder: Cylinder) -> ObjectGaps:
    """
    Measure the distances of an object, and how they change when the rollers move.

    :raises ConfigurationError: the configuration is singular.
    """
    robot, points = config.robot, config.points
    layout, m = robot.layout, robot.layout.n_modules
    center, radius = complex(*cylinder.center), 0.5 * cylinder.diameter
    velocities = _node_velocities(config)
    begin, end, entry = layout.b, layout.c[layout.following], layout.c
    along, turning = points[end] - points[begin], velocities[end] - velocities[begin]

    side = nearest_on_side(np.full(m, center), points[begin], along)
    skin = side.distance - (radius + 0.5 * robot.description.tube_diameter)
    approached = velocities[begin] + side.share[:, None] * turning
    by_members = -(side.normal.conj()[:, None] * approached).real

    away = center - 0.5 * (points[begin] + points[entry])
    distance = np.abs(away)
    middles = 0.5 * (velocities[begin] + velocities[entry])
    by_modules = -(away.conj()[:, None] * middles).real / distance[:, None]

    angles = (along.conj()[:, None] * turning).imag / (np.abs(along) ** 2)[:, None]
    back = -along[layout.previous]
    turn = np.angle(along.conj() * back)
    by_openings = np.sign(turn)[:, None] * (angles[layout.previous] - angles)
    return ObjectGaps(
        skin,
        distance - (radius + bodies(robot).radius),
        np.abs(turn),
        np.concatenate([by_members, by_modules, by_openings]),
    )


def encloses(config: Configuration, tube: int, point: complex) -> bool:
    """Return whether a point is inside the loop that a tube makes."""
    layout = config.robot.layout
    modules = np.flatnonzero(layout.tube == tube)
    corners = np.stack(
        [config.points[layout.c[modules]], config.points[layout.b[modules]]], axis=1
    )
    around = corners.ravel() - point
    winding = np.angle(np.roll(around, -1) / around).sum() / (2.0 * np.pi)
    return bool(abs(winding) > 0.5)


def _node_velocities(config: Configuration) -> Points:
    """Return the velocities of the nodes (n, r), x + iy, for 1 m/s at each roller, by (12)."""
    layout = config.robot.layout
    right = np.zeros((config.robot.constraints.n_rows, len(layout.driven)))
    right[: layout.n_modules] = layout.incidence
    moved = np.asarray(config.factor.solve(right))
    return moved[0::2] + 1j * moved[1::2]
