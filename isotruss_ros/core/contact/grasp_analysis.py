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
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.records import Record
from isotruss_ros.core.statics.structure import Structure
import numpy as np
from scipy.linalg import lapack


class SolvedContact(NamedTuple):
    """Solved contact at points of the tubes, with its extent on each of the m members."""

    points: ContactPoints  #: candidate contact points
    contact: ContactState  #: contact with its forces
    length: Array  #: (m,) length of tube in contact [m]; zero without contact
    #: (m, 2) start and end of the contact from the member's start [m]; (inf, -inf) without contact
    spans: Array
    #: (k,) indices of the points near contact regions; the result contains only these
    region_points: Indices


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

    :ivar points: (k, 2) deformed points on the skin of the tubes, robot frame [m]; in the paper's
        model, on the centre lines.
    :ivar members: (k,) index of the member of each point in `Robot.member_names`.
    :ivar places: (k,) distance of each point from the member's start [m].
    :ivar gaps: (k,) distances of the tube's skin from the object, not negative [m].
    :ivar normals: (k, 2) outward unit normals of the object's surface. At a corner over which the
        skin is folded, they are replaced by normals nearly perpendicular to the tube, see
        `turn_at_corners`. Then the sum of forces times normals differs from the exact
        `normal_wrench`: by 0.3 % on an ellipse, by a tenth to a quarter at sharp corners, and not
        at all on discs.
    :ivar normal_forces: (k,) normal forces along `normals`, not negative [N].
    :ivar friction_forces: (k,) friction on the object along its tangents, counter-clockwise [N].
    :ivar normal_wrench: wrench (fx, fy, m) of the tubes on the object without friction, about the
        origin of the object's frame [N, N m]. The forces are normal to the bent centre lines.
    :ivar closed_by_friction: whether the object has contact and friction balances the normal
        forces and the external wrench, equation (10). For a free object see `SettledGrasp`.
    :ivar closure_residual: norm of the wrench that friction does not balance [N]; moments are
        about the centroid and divided by half of the object's mean width, d/2 of a cylinder.
    :ivar closure_tolerance: largest residual that counts as closure [N].
    :ivar required_friction: smallest coefficient of friction with closure; infinite if none.
    :ivar closure_margin: largest norm of an additional wrench that friction balances in every
        direction, with moments divided by half of the object's mean width [N]; negative without
        closure.
    :ivar contact_lengths: length of tube in contact, for each member in contact [m].
    :ivar contact_spans: distances of the contact's start and end from the member's start, for each
        member in contact [m].
    :ivar contact_forces: sum of the normal forces, for each member in contact [N].
    :ivar contact_widths: largest width of the contact around the tube, for each member in contact,
        at most half of the circumference [m]. This field and the next three are empty in the
        paper's model.
    :ivar contact_areas: area of contact, for each member in contact [m^2].
    :ivar contact_pressures: mean contact pressure, for each member in contact [Pa].
    :ivar peak_pressures: largest contact pressure, for each member in contact [Pa].
    :ivar flattened: names of the members whose contact is as wide as half of the circumference.
        Their section is flat there, and the model no longer holds for depth and force.
    :ivar utilisation: largest ratio of bending moment to wrinkling moment, for each member [-]. At
        1 and above the tube wrinkles, and the model no longer holds.
    :ivar utilisation_places: distance of the largest utilisation from the member's start, for each
        member [m].
    :ivar center: origin of the object's frame, x + iy [m].
    :ivar structure: structural model of the robot.
    :ivar solved: the solved contact from which this analysis was computed.
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
    @single_threaded
    def stiffness(self) -> Array:
        """
        Return the robot's stiffness against motion of the object, (3, 3) [N/m, N, N m].

        The stiffness is the derivative of the wrench (fx, fy, m) by the displacement (dx, dy,
        dtheta), without slip at the contacts.

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
    @single_threaded
    def nonlinearity(self) -> float:
        """
        Return the relative increase of the contact forces due to geometric nonlinearity [-].

        The forces are compared with those of a linear model with straight tubes. The
        increase is computed to first order, from the work of the contact forces. It is zero in the
        paper's model.
        """
        points, contact = self.solved.points, self.solved.contact
        if points.bent.is_straight or not contact.forces.any():
            return 0.0
        linear = points.about(points.bent.bent_to(None))
        moved = points.skin + contact.displacements - linear.skin
        given = linear.displacements(contact.push)
        work, linear_work = ((contact.push.conj() * each).real.sum() for each in (moved, given))
        return float(linear_work / work - 1.0)
