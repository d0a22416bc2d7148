# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Result of `analyze_grasp`."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

from isotruss_ros.core.contact.contact_points import ContactPoints, ContactState
from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.records import Record
from isotruss_ros.core.statics.structure import Structure
import numpy as np
from scipy.linalg import lapack


class SolvedContact(NamedTuple):
    """
    Contact at points of the tubes, with its extent on each of the m members.

    :ivar points: points that the object could touch.
    :ivar contact: where it does, and with what force.
    :ivar length: (m,) of tube in contact, zero where there is none [m].
    :ivar spans: (m, 2) where contact begins and ends, from the member's start; inf, -inf without
        [m].
    :ivar kept: (k,) which of the points are the answer; the others only served to find it.
    """

    points: ContactPoints
    contact: ContactState
    length: Array
    spans: Array
    kept: Indices


@dataclass(frozen=True, eq=False, repr=False)
class GraspAnalysis(
    Record,
    headline=(
        'closed_by_friction',
        'required_friction',
        'closure_margin',
        'contact_forces',
        'utilisation',
    ),
):
    """
    Contact, closure and stiffness of a grasp with k contact points.

    :ivar points: (k, 2) what meets the object, deformed, robot frame: the skin of the tubes; in
        the paper's model their centre lines, half a tube diameter farther out [m].
    :ivar members: (k,) the member that each point is on, by its place in `Robot.member_names`.
    :ivar places: (k,) where that is along the member, from its start [m].
    :ivar gaps: (k,) distance of the tube's skin from the object there, not negative [m].
    :ivar normals: (k, 2) unit normals of the object's surface, outward: toward the tube; at a
        corner over which the skin is folded nearly across the tube, see `turn_at_corners`.
        Except for discs, normals times forces sum up to less or more than `normal_wrench`, which
        counts: by 0.3 % on an ellipse, by a tenth and at most a quarter at sharp corners.
    :ivar normal_forces: (k,) pressing tube and object apart, along `normals`, not negative [N].
    :ivar friction_forces: (k,) on the object, along the tangent, counter-clockwise [N].
    :ivar normal_wrench: (fx, fy, m) with which the tubes press on the object without friction,
        across their bent centre lines, about the origin of its frame, the centre of a cylinder
        [N, N m].
    :ivar closed_by_friction: whether the object is touched, and friction balances the normal
        forces and the external wrench, equation (10); see `SettledGrasp` for a free object.
    :ivar closure_residual: what friction leaves, moments about the middle of the area over half of
        the mean width, d/2 of a cylinder [N].
    :ivar closure_tolerance: below which the residual counts as none [N].
    :ivar required_friction: smallest coefficient that closes; infinite if none does.
    :ivar closure_margin: largest extra wrench of any direction that friction still balances,
        moments over half of the mean width [N]; negative where the grasp is open.
    :ivar contact_lengths: length of tube in contact by member, of those in contact [m].
    :ivar contact_spans: where along the member contact begins and ends, from the member's start,
        by member, of those in contact [m].
    :ivar contact_forces: sum of the normal forces by member, of those in contact [N].
    :ivar contact_widths: largest width of contact around the tube by member, of those in contact,
        at most half the circumference; none in the paper's model, as the following three [m].
    :ivar contact_areas: area of contact by member, of those in contact [m^2].
    :ivar contact_pressures: mean pressure of contact by member, of those in contact [Pa].
    :ivar peak_pressures: largest pressure of contact by member, of those in contact [Pa].
    :ivar flattened: names of the members whose contact is as wide as half the circumference
        somewhere: the section is flat there, and depth and force are outside of the model.
    :ivar utilisation: largest bending moment over the wrinkling moment, by member, of all members;
        from 1 on a tube wrinkles, and all numbers are outside of the model.
    :ivar utilisation_places: where along the member that is, from its start, of all members [m].
    :ivar center: origin of the object's frame, x + iy [m].
    :ivar structure: the frame of the robot.
    :ivar solved: the contact, with normals at corners as they are assessed.
    """

    points: Array
    members: Indices
    places: Array
    gaps: Array
    normals: Array
    normal_forces: Array
    friction_forces: Array
    normal_wrench: Array
    closed_by_friction: bool
    closure_residual: float
    closure_tolerance: float
    required_friction: float
    closure_margin: float
    contact_lengths: dict[str, float]
    contact_spans: dict[str, tuple[float, float]]
    contact_forces: dict[str, float]
    contact_widths: dict[str, float]
    contact_areas: dict[str, float]
    contact_pressures: dict[str, float]
    peak_pressures: dict[str, float]
    flattened: tuple[str, ...]
    utilisation: dict[str, float]
    utilisation_places: dict[str, float]
    center: complex = field(repr=False)
    structure: Structure = field(repr=False)
    solved: SolvedContact = field(repr=False)

    @cached_property
    def stiffness(self) -> Array:
        """
        Return the wrench (fx, fy, m) by displacements (dx, dy, dtheta) of the object, (3, 3).

        All its contact points move with it [N/m, N, N m].

        :raises SolverError: the contact compliance is not positive definite.
        """
        points, contact = self.solved.points, self.solved.contact
        touching = np.flatnonzero(contact.forces > 0.0)
        if len(touching) == 0:
            return np.zeros((3, 3))
        if not points.bent.is_straight:
            points = points.about(points.bend_on(contact.push))
        compliance, size = points.compliance(touching), 2 * len(touching)
        arms = (points.skin + points.displacements(contact.push))[touching] - self.center
        # Motions of the object by dx, dy, dtheta, along and across the tube at each contact.
        inward = points.axis[touching].conj()
        local = inward * np.stack([np.ones_like(arms), np.full_like(arms, 1j), 1j * arms])
        motion = np.concatenate([local.real, local.imag], axis=1).T
        _, forces, failed = lapack.dposv(compliance.reshape(size, size), motion)
        if failed:
            raise SolverError('the contact compliance is not positive definite')
        stiffness = motion.T @ forces
        return 0.5 * (stiffness + stiffness.T)

    @cached_property
    def nonlinearity(self) -> float:
        """
        Return how much more the bent tubes press than linear ones would, as a share [-].

        To first order, from the work of the contact forces: zero in the paper's model.
        """
        points, contact = self.solved.points, self.solved.contact
        if points.bent.is_straight or not contact.forces.any():
            return 0.0
        linear = points.about(points.bent.bent_to(None))
        moved = points.skin + contact.displacements - linear.skin
        given = linear.displacements(contact.push)
        work, linear_work = ((contact.push.conj() * each).real.sum() for each in (moved, given))
        return float(linear_work / work - 1.0)
