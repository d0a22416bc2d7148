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

    :ivar points: candidate contact points.
    :ivar contact: contact with its forces.
    :ivar length: (m,) length of tube in contact, zero without [m].
    :ivar spans: (m, 2) start and end of the contact from the member's start; inf, -inf without
        [m].
    :ivar kept: (k,) indices of the points of the result; the others were part of the search.
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

    :ivar points: (k, 2) deformed points of the skin of the tubes, robot frame; in the paper's
        model those of their centre lines [m].
    :ivar members: (k,) index of the member of each point in `Robot.member_names`.
    :ivar places: (k,) distance of each point from the member's start [m].
    :ivar gaps: (k,) distances of the tube's skin from the object, not negative [m].
    :ivar normals: (k, 2) unit normals of the object's surface, outward: toward the tube; at a
        corner over which the skin is folded nearly across the tube, see `turn_at_corners`.
        Except for discs, normals times forces sum up to less or more than `normal_wrench`, which
        counts: by 0.3 % on an ellipse, by a tenth and at most a quarter at sharp corners.
    :ivar normal_forces: (k,) normal forces along `normals`, not negative [N].
    :ivar friction_forces: (k,) friction on the object, along the tangent, counter-clockwise [N].
    :ivar normal_wrench: wrench (fx, fy, m) of the frictionless tubes on the object, across their
        bent centre lines, about the origin of its frame [N, N m].
    :ivar closed_by_friction: whether the object has contact, and friction balances the normal
        forces and the external wrench, equation (10); see `SettledGrasp` for a free object.
    :ivar closure_residual: unbalanced wrench, moments about the centroid over half of the mean
        width, d/2 for a cylinder [N].
    :ivar closure_tolerance: bound of the residual [N].
    :ivar required_friction: smallest coefficient with closure; infinite if none exists.
    :ivar closure_margin: largest additional wrench of any direction with closure, moments over
        half of the mean width [N]; negative without closure.
    :ivar contact_lengths: length of tube in contact by member in contact [m].
    :ivar contact_spans: start and end of the contact from the member's start, by member in contact
        [m].
    :ivar contact_forces: sum of the normal forces by member in contact [N].
    :ivar contact_widths: largest width of the contact around the tube by member in contact, at
        most half the circumference [m]; empty in the paper's model, like the next three.
    :ivar contact_areas: area of contact by member in contact [m^2].
    :ivar contact_pressures: mean contact pressure by member in contact [Pa].
    :ivar peak_pressures: largest contact pressure by member in contact [Pa].
    :ivar flattened: names of the members with a contact as wide as half the circumference: the
        section is flat there, and depth and force are outside of the model.
    :ivar utilisation: largest bending moment over the wrinkling moment by member, all members;
        from 1 on a tube wrinkles, and the results are outside of the model.
    :ivar utilisation_places: its distance from the member's start, all members [m].
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
        Return the stiffness of the object with sticking contacts, (3, 3) [N/m, N, N m].

        Wrench (fx, fy, m) per displacement (dx, dy, dtheta).

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
        Return the relative excess force of bent over linear tubes [-].

        To first order, from the work of the contact forces; zero in the paper's model.
        """
        points, contact = self.solved.points, self.solved.contact
        if points.bent.is_straight or not contact.forces.any():
            return 0.0
        linear = points.about(points.bent.bent_to(None))
        moved = points.skin + contact.displacements - linear.skin
        given = linear.displacements(contact.push)
        work, linear_work = ((contact.push.conj() * each).real.sum() for each in (moved, given))
        return float(linear_work / work - 1.0)
