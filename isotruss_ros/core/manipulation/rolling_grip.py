# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Rolling of an object in a grip; its pose is computed from the configuration without drift.

A rolling contact has two rolling invariants: the gap of the object from the member, and the
anchor. The anchor is the position of the contact on the tube's material minus the arc length of
the object that has rolled off:

    Im(conj(e) (p - B)) = gap,   Re(conj(e) (p - B)) - phi - arc = anchor

with the start B of the member, its direction e, the point of contact p, and the travel phi of the
tube into the member. The time derivative of the invariants is the constraint J_h(q) qdot = G^T nu.
Gaps are positive toward the object; arcs are positive along the member.
"""

from __future__ import annotations

import cmath
from dataclasses import dataclass, replace
import itertools
import math
from typing import NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import find_contacts, find_members, Grip, lifting_choices
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.tolerances import COINCIDENCE, MAX_NEWTON_ITERATIONS, ROUNDING
import numpy as np


@dataclass(frozen=True, eq=False)
class RollingGrip:
    """
    Grip in one configuration, with the rolling invariants of its k contacts.

    :ivar config: the configuration.
    :ivar grip: the grip, with the object at its pose.
    :ivar angles: (m,) angles of the members' normals in the object's frame, not wrapped to one
        turn [rad].
    :ivar owners: (k,) grasping member of each contact, numbered within the grip; a member has one
        contact, or two if a face touches it.
    :ivar corners: (k,) index of the polygon's corner at each contact.
    :ivar invariants: (2, k) gaps from the centre lines, and anchors along the tubes, as defined at
        the top of this module [m].
    :ivar sides: (m,) +1 for an object on the left of the member, -1 on the right.
    :ivar shape: shape of the object that is used for the contacts, see `Shape.smoothed`.
    :ivar misfit: largest deviation from the invariants [m]. It is not zero if the rollers moved
        the members toward each other or apart, or if contacts slipped.
    """

    config: Configuration
    grip: Grip
    angles: Array
    owners: Indices
    corners: Indices
    invariants: Array
    sides: Array
    shape: Shape
    misfit: float = 0.0

    @classmethod
    @check_kinds
    def attach(cls, config: Configuration, grip: Grip) -> RollingGrip:
        """
        Return a rolling grip that starts at a given configuration and pose of the object.

        :param config: configuration of the robot.
        :param grip: the grip, with the object at its pose.
        :raises GraspError: see `find_contacts`.
        """
        contacts = find_contacts(config, grip)
        owners, corners = np.array([(contact.owner, contact.corner) for contact in contacts]).T
        # Sides and normals are the same at all contacts of a member.
        of_members = {contact.owner: contact for contact in contacts}.values()
        sides = np.array([contact.side for contact in of_members])
        normals = np.array([contact.normal for contact in of_members])
        angles = np.angle(normals * grip.body.turn.conjugate())
        shape = grip.body.shape.smoothed(0.5 * config.robot.description.tube_diameter)
        # The other fields determine the invariants.
        unset = np.zeros((2, len(owners)))
        rolling = cls(config, grip, angles, owners, corners, unset, sides, shape)
        angle = grip.body.pose.angle
        invariants, _ = rolling._evaluate(rolling._lines(config), grip.center, angle, corners)
        return replace(rolling, invariants=invariants)

    @property
    def pose(self) -> Pose:
        """Return the object's pose; the angle is in (-pi, pi]."""
        x, y, angle = self.grip.body.pose
        return Pose(x, y, math.remainder(angle, 2.0 * math.pi))

    def moved_to(self, config: Configuration) -> RollingGrip:
        """
        Return the grip after the object has rolled to another configuration.

        A face that touches a member may lift at one of its ends. If no pose has these invariants,
        the pose minimises the squared deviations from them, and `misfit` is the largest deviation.

        :param config: a configuration so close that the object rotates by less than half a turn.
        :raises GraspError: no pose of the object is found; or a member no longer touches the
            object.
        """
        if config is self.config:
            return self
        rolled = self._rolled(config)
        touches_faces = len(self.owners) > len(self.sides)
        if rolled.misfit <= ROUNDING or not touches_faces:
            return rolled
        # Faces may have lifted at one of their ends.
        for choice in lifting_choices(self.owners.tolist()):
            pressed = list(itertools.chain(*choice))
            with_fewer_contacts = replace(
                self,
                owners=self.owners[pressed],
                corners=self.corners[pressed],
                invariants=self.invariants[:, pressed],
            )
            lifted = with_fewer_contacts._rolled(config)
            if lifted.misfit < rolled.misfit:
                # A lifted end must not penetrate the member.
                center, angle = lifted.grip.center, lifted.grip.body.pose.angle
                (gaps, _), _ = self._evaluate(self._lines(config), center, angle, self.corners)
                if (gaps >= self.invariants[0] - lifted.misfit - ROUNDING).all():
                    rolled = lifted
        return rolled

    def _rolled(self, config: Configuration) -> RollingGrip:
        """Return the grip in another configuration with the same contacts."""
        body, lines, corners = self.grip.body, self._lines(config), self.corners
        center, angle, owners = body.center, body.pose.angle, self.owners
        # Gauss-Newton method on the deviations from the invariants.
        for iteration in range(MAX_NEWTON_ITERATIONS):
            # A single contact is at the outermost corner; both ends of a face remain. Corners are
            # fixed after some iterations, because rounding errors may cause cycles.
            if iteration < 10 and not self.shape.is_round:
                is_single = np.bincount(owners)[owners] == 1
                normals = lines.normals * cmath.rect(1.0, -angle)
                farthest = np.array([self.shape.corner_at(n) for n in normals.tolist()])
                corners = np.where(is_single, farthest[owners], self.corners)

            # Step in x, y and the arc, which is the rotation times the arm.
            values, rates = self._evaluate(lines, center, angle, corners)
            deviations = (values - self.invariants).ravel()
            rows = rates * (1.0, 1.0, 1.0 / body.arm)
            x, y, arc = step = np.linalg.lstsq(rows, -deviations, rcond=ROUNDING)[0]
            center += complex(x, y)
            angle += arc / body.arm
            step_size = max(abs(x), abs(y), abs(arc))
            has_converged = step_size <= COINCIDENCE * max(1.0, abs(center) / body.arm)
            # The invariants of a disc are linear in the step.
            has_converged |= body.shape.is_round and step_size <= body.arm
            if has_converged or not step_size <= body.arm:
                break
        if not has_converged:
            raise GraspError(
                'no pose of the object keeps its contacts in the new configuration: take smaller '
                'steps, or roller speeds that neither open nor close the grip'
            )

        misfit = float(np.abs(deviations + rows.dot(step)).max())
        grip = self.grip.moved_to((center.real, center.imag, angle))
        if grip.corners is not None:
            grip = grip.touching(self.owners, corners)
        find_contacts(config, grip)  # raises if the object has left a member
        angles = self._unwrapped(lines.normals, angle)
        return replace(
            self, config=config, grip=grip, angles=angles, corners=corners, misfit=misfit
        )

    def _unwrapped(self, normals: Points, angle: float) -> Array:
        """Return the angles (m,) of normals relative to an object, continuous beyond one turn."""
        return self.angles + np.angle(normals * np.exp(-1j * (angle + self.angles)))

    def _lines(self, config: Configuration) -> _Lines:
        """Return the members' centre lines in a configuration."""
        nodes = find_members(config.robot.topology, self.grip.members)
        starts, ends = config.points[nodes.lines.T]
        spans = ends - starts
        axes = spans / np.abs(spans)
        travel = np.zeros(len(nodes.members))
        travel[nodes.driven] = config.roller_positions[nodes.rollers]
        return _Lines(starts, axes, axes * (-1j * self.sides), travel)

    def _evaluate(
        self, lines: _Lines, center: complex, angle: float, corners: Indices
    ) -> tuple[Array, Array]:
        """
        Return the rolling invariants (2, k) of contacts at given corners, for an object's pose.

        The second array (2 k, 3) has their derivatives with respect to the object's twist.
        """
        shape, turn, owners = self.shape, cmath.rect(1.0, angle), self.owners
        axes, sides = lines.axes[owners], self.sides[owners]
        # Invariants of the points of contact, with components along (real) and across the members.
        normals = lines.normals * turn.conjugate()
        arms = turn * shape.surface_at(corners, normals[owners])[0]
        from_starts = axes.conj() * (center + arms - lines.starts[owners])
        arcs = shape.unroll(self._unwrapped(lines.normals, angle)[owners], corners)
        gaps = sides * from_starts.imag
        anchors = from_starts.real - lines.travel[owners] - sides * arcs
        # Rates Im and Re of conj(e) (v + i omega arm), as of points fixed to the object: a contact
        # that moves along the surface changes no gap, and its position as much as the arc.
        local_arms = axes.conj() * arms
        gap_rates = np.stack([-axes.imag, axes.real, local_arms.real], axis=1) * sides[:, None]
        anchor_rates = np.stack([axes.real, axes.imag, -local_arms.imag], axis=1)
        return np.array([gaps, anchors]), np.concatenate([gap_rates, anchor_rates])


class _Lines(NamedTuple):
    """Centre lines of the m members of a grip in one configuration."""

    starts: Points  #: starts of the members, x + iy [m]
    axes: Points  #: unit vectors along the members, x + iy
    normals: Points  #: unit normals away from the object, x + iy
    travel: Array  #: travel of the tubes into the members [m]


def roll_object(grip: Grip, start: Configuration, end: Configuration) -> Grip:
    """Return a grip after its object has rolled from one configuration to another."""
    return RollingGrip.attach(start, grip).moved_to(end).grip
