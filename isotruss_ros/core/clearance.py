"""
Distances between parts of the robot that must not meet, and between the robot and an object.

A member is its straight tube from pinch point to pinch point. A module is a disc round the middle
of its pinch points, large enough for the pinched tube and for the joint: radius
max(s/2 + tube radius, h). Distances are between surfaces [m], negative where they overlap.

Which pairs: a straight tube that comes to another does so first with an end of one of them, and
the ends lie inside the discs of modules. So it is enough to keep modules away from members and
from other modules; two members then never come closer than their discs do.

What meets at a joint is left out. The tubes of two triangles that share a joint run past it, and
over each other, already at home: they lie at different heights there, and turn about the joint.
How far one may swing over the other is bounded all the same, because the module at the far end of
either keeps its distance from the other; so do the sides of a corner, by the same pairs. Two
modules next to each other on a tube are left to the limit of the length between them.

A pair that overlaps already at home cannot lie in one plane, so it is left out too, and named in
`Bodies.overlapping`.
"""

from __future__ import annotations

import functools

from isotruss_ros.core.arrays import pairs as pairs_of
from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.grasp import Grasp, grasp_rows, module_index
from isotruss_ros.core.grasp_analysis import Cylinder
from isotruss_ros.core.nearest import nearest_on_side, TINY
from isotruss_ros.core.robot import Robot
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Points = NDArray[np.complex128]
Indices = NDArray[np.intp]


class Bodies:
    """
    The parts of a robot that must not meet.

    :ivar radius: of a module's disc [m].
    :ivar overlapping: the pairs that are left out because they overlap at home.
    :param robot: the robot.
    """

    def __init__(self, robot: Robot) -> None:
        layout, file = robot.layout, robot.description
        m = layout.n_modules
        self._robot = robot
        self._tube = 0.5 * file.tube_diameter
        half = 0.5 * file.module.pinch_separation
        self.radius = max(half + self._tube, file.module.rod_length)
        self._to = layout.c[layout.following]
        ends = np.stack([layout.joint, layout.joint[layout.following]])
        apart = (layout.joint[:, None] != ends[0]) & (layout.joint[:, None] != ends[1])
        self._module, self._member = np.nonzero(apart)
        modules = np.arange(m)
        other = np.triu(layout.joint[:, None] != layout.joint)
        other &= layout.following[:, None] != modules
        other &= layout.previous[:, None] != modules
        self._one, self._two = np.nonzero(other)
        self.overlapping: tuple[str, ...] = ()
        keep = self.distances(robot.home) > 0.0
        self.overlapping = tuple(self.names(np.flatnonzero(~keep)))
        sides = len(self._module)
        self._module, self._member = self._module[keep[:sides]], self._member[keep[:sides]]
        self._one, self._two = self._one[keep[sides:]], self._two[keep[sides:]]

    def names(self, pairs: Indices) -> list[str]:
        """Return what the pairs of these numbers are, for people."""
        modules, members = self._robot.module_names, self._robot.member_names
        sides = len(self._module)
        return [
            f'module {modules[self._module[i]]} and member {members[self._member[i]]}'
            if i < sides
            else f'modules {modules[self._one[i - sides]]} and {modules[self._two[i - sides]]}'
            for i in pairs
        ]

    def distances(self, config: Configuration, pairs: Indices | None = None) -> Array:
        """
        Return the distances between the surfaces of pairs [m].

        :param pairs: (k,) numbers of pairs, ascending; all when left out.
        """
        middle, start, along = self._places(config)
        module, member, one, two = self._parts(pairs)
        side = nearest_on_side(middle[module], start[member], along[member])
        return np.concatenate(
            [
                side.distance - (self.radius + self._tube),
                np.abs(middle[one] - middle[two]) - 2.0 * self.radius,
            ]
        )

    def gradients(self, config: Configuration, pairs: Indices) -> Array:
        """
        Return how the distances of some pairs change as nodes move.

        :param pairs: (k,) numbers of pairs, ascending.
        :return: (k, 2n) rows on the node velocities (x0, y0, x1, y1, ...) [-].
        """
        middle, start, along = self._places(config)
        module, member, one, two = self._parts(pairs)
        rows = np.zeros((len(pairs), len(config.points)), dtype=np.complex128)
        sides, others = np.arange(len(module)), np.arange(len(module), len(pairs))
        near = nearest_on_side(middle[module], start[member], along[member])
        self._push_modules(rows, sides, module, near.normal)
        self._push_members(rows, sides, member, -near.normal, near.share)
        if len(others):
            away = middle[one] - middle[two]
            normal = away / np.maximum(np.abs(away), TINY)
            self._push_modules(rows, others, one, normal)
            self._push_modules(rows, others, two, -normal)
        return rows.view(np.float64)

    def object_distances(
        self, config: Configuration, cylinder: Cylinder | Grasp, grip: str | None
    ) -> Array:
        """
        Return the distances between an object and members and modules [m].

        :param cylinder: the object.
        :param grip: the module `t/j` that holds it, or None for an object that lies free. What
            meets at the joint of the grip is left out: the grip itself touches the object, and
            another tube that meets there lies over or under it, or would be in its way already.
        :return: (2m,) members, modules; inf for what is left out.
        :raises GraspError: no such module.
        """
        layout = self._robot.layout
        center, radius = complex(*cylinder.center), 0.5 * cylinder.diameter
        middle, start, along = self._places(config)
        members = nearest_on_side(center, start, along).distance - (radius + self._tube)
        modules = np.abs(center - middle) - (radius + self.radius)
        if grip is not None:
            i = module_index(self._robot, grip)
            near = layout.joint == layout.joint[i]
            members[near | near[layout.following]] = np.inf
            modules[near] = np.inf
        return np.concatenate([members, modules])

    def object_gradients(self, config: Configuration, grasp: Grasp, parts: Indices) -> Array:
        """
        Return how the distances of a held object from some parts change as nodes move.

        The object moves with the grip (15).

        :param parts: (k,) numbers as in `object_distances`.
        :return: (k, 2n) rows on the node velocities [-].
        :raises GraspError: see `grasp_rows`.
        """
        m, center = self._robot.layout.n_modules, complex(*grasp.center)
        middle, start, along = self._places(config)
        rows = np.zeros((len(parts), len(config.points)), dtype=np.complex128)
        on_side = parts < m
        members, modules = parts[on_side], parts[~on_side] - m
        near = nearest_on_side(center, start[members], along[members])
        self._push_members(rows, np.flatnonzero(on_side), members, -near.normal, near.share)
        normal = np.empty(len(parts), dtype=np.complex128)
        away = center - middle[modules]
        normal[on_side] = near.normal
        normal[~on_side] = away / np.maximum(np.abs(away), TINY)
        self._push_modules(rows, np.flatnonzero(~on_side), modules, -normal[~on_side])
        return rows.view(np.float64) + pairs_of(normal) @ grasp_rows(config, grasp).nodes[:2]

    def object_names(self) -> list[str]:
        """Return what the object is near to, in the order of `object_distances`."""
        return [
            *(f'member {name}' for name in self._robot.member_names),
            *(f'module {name}' for name in self._robot.module_names),
        ]

    def _places(self, config: Configuration) -> tuple[Points, Points, Points]:
        """Return the middle of the pinch points, where members begin, and to where they go."""
        points, layout = config.points, self._robot.layout
        start = points[layout.b]
        middle = 0.5 * (start + points[layout.c])
        return middle, start, points[self._to] - start

    def _parts(self, pairs: Indices | None) -> tuple[Indices, Indices, Indices, Indices]:
        """Return the modules and members of pairs, and the modules and modules."""
        if pairs is None:
            return self._module, self._member, self._one, self._two
        sides = len(self._module)
        count = int(pairs.searchsorted(sides))
        first, second = pairs[:count], pairs[count:] - sides
        return self._module[first], self._member[first], self._one[second], self._two[second]

    def _push_modules(self, rows: Points, places: Indices, modules: Indices, by: Points) -> None:
        """Add to rows what moving the middle of modules is worth."""
        rows[places, self._robot.layout.b[modules]] += 0.5 * by
        rows[places, self._robot.layout.c[modules]] += 0.5 * by

    def _push_members(
        self, rows: Points, places: Indices, members: Indices, by: Points, share: Array
    ) -> None:
        """Add to rows what moving points of members is worth."""
        rows[places, self._robot.layout.b[members]] += (1.0 - share) * by
        rows[places, self._to[members]] += share * by


@functools.lru_cache(maxsize=16)
def bodies(robot: Robot) -> Bodies:
    """Return the parts of a robot that must not meet; made once for each robot."""
    return Bodies(robot)
