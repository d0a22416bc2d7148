# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The paper's analysis of a grasp: contact forces (5) to (9) and closure by friction (10)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from isotruss_ros.core.errors import GraspError, SolverError
from isotruss_ros.core.fixed_object.contact import (
    ContactState,
    relax_contact,
    RelaxationGains,
    solve_contact,
)
from isotruss_ros.core.fixed_object.contact_points import (
    find_contact_points,
    Surface,
)
from isotruss_ros.core.fixed_object.friction_closure import balance_by_friction
from isotruss_ros.core.fixed_object.straight_compliance import find_utilisation
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.model.convex_object import check_load, ConvexObject
from isotruss_ros.core.model.pose import check_range
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import Array, finite_array, Indices, Points
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.records import Record
from isotruss_ros.core.statics.structure import structure_of
from isotruss_ros.core.statics.tube_stiffness import Pressure
import numpy as np
from numpy.typing import ArrayLike

#: Result of an analysis without contacts, in words.
NO_CONTACT = 'the object touches nothing'
#: Range of admissible spacings of contact points [m].
SPACING_RANGE = (1e-4, 0.1)
#: Methods that solve (8).
METHODS = 'exact', 'relaxation'


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
    """Contact and closure of an object held fast, with k contact points: (5) to (10)."""

    points: Array  #: (k, 2) deformed points on the centre lines of the tubes, robot frame [m]
    members: Indices  #: (k,) index of the member of each point in `Robot.member_names`
    places: Array  #: (k,) distance of each point from the member's start [m]
    gaps: Array  #: (k,) distances of the tube's skin from the object, not negative [m]
    normals: Array  #: (k, 2) outward unit normals of the object's surface
    normal_forces: Array  #: (k,) normal forces along `normals`, not negative [N]
    #: (k,) friction on the object along its tangents, counter-clockwise [N]
    friction_forces: Array
    #: wrench (fx, fy, m) of the tubes on the object without friction, about the origin of the
    #: object's frame [N, N m]
    normal_wrench: Array
    #: whether the object has contact and friction balances the normal forces and the external
    #: wrench, equation (10). For a free object see `SettledGrasp`
    closed_by_friction: bool
    #: norm of the wrench that friction does not balance [N]; moments are about the centroid and
    #: divided by half of the object's mean width, d/2 of a cylinder
    closure_residual: float
    closure_tolerance: float  #: largest residual that counts as closure [N]
    required_friction: float  #: smallest coefficient of friction with closure; infinite if none
    #: largest norm of an additional wrench that friction balances in every direction, with moments
    #: divided by half of the object's mean width [N]; negative without closure
    closure_margin: float
    contact_lengths: dict[str, float]  #: length of tube in contact, for each member in contact [m]
    contact_forces: dict[str, float]  #: sum of the normal forces, for each member in contact [N]
    #: largest ratio of bending moment to wrinkling moment, for each member [-]. At 1 and above the
    #: tube wrinkles, and the model no longer holds
    utilisation: dict[str, float]


@check_kinds
@single_threaded
def analyze_grasp(
    config: Configuration,
    body: ConvexObject,
    friction: float | None = None,
    external_wrench: ArrayLike = (0.0, 0.0, 0.0),
    method: Literal['exact', 'relaxation'] = 'exact',
    spacing: float = 0.005,
    pressure: Pressure | None = None,
    gains: tuple[float, float, float] | None = None,
) -> GraspAnalysis:
    """
    Compute contact forces (5) to (9) and closure by friction (10) of an object held fast.

    The model is the paper's: linear statics (1) to (4), straight tubes, round sections, and no
    friction in the deformation. For an object that is free, as one that is really held, use
    `settle_grasp`.

    :param config: configuration of the robot, with rollers at rest.
    :param body: the object at its pose.
    :param friction: coefficient of friction between tube and object, not negative. If None, the
        coefficient of the object is used, or 0.5 if the object has none.
    :param external_wrench: (fx, fy, m) on the object about the origin of its frame [N, N m].
    :param method: 'exact' (the complementarity problem is solved by nonnegative least squares) or
        'relaxation' (it is solved by the paper's iteration (9)).
    :param spacing: spacing of the contact points along the tubes [m].
    :param pressure: gauge pressure from 1e3 to 3e5 [Pa], given as one number for all tubes, as one
        number for each tube in the order of the robot file, or as a mapping from tube names to
        pressures. If None, the pressure of the robot file is used.
    :param gains: gains K1 [N/m], K2 [-] and K3 [1/m] of the iteration (9), not negative, used by
        'relaxation'. If None, gains are used with which it converges for most grasps of the
        presets.
    :raises GraspError: an argument is invalid.
    :raises StructureError: the robot is a mechanism, a pressure is invalid, or the stiffness laws
        contradict each other.
    :raises SolverError: the contact problem was not solved, (9) did not converge, or the object
        overlaps a member by more than a tube diameter.
    """
    mu, wrench = check_load(body, friction, external_wrench)
    spacing = _check_arguments(config, body, method, spacing)
    surface = Surface(body, 0.5 * config.robot.description.tube_diameter)
    structure = structure_of(config, pressure)
    points, places, tubes = find_contact_points(structure, surface, spacing)
    if method == 'exact':
        contact = solve_contact(points, surface)
    else:
        contact = relax_contact(points, surface, None if gains is None else _check_gains(gains))
    deformed, forces = points.points + contact.displacements, contact.forces
    normal_wrench, levers = _sum_pressure(surface, deformed, contact)
    # The moment of the load about the centroid, divided by half of the object's mean width.
    x, y, moment = normal_wrench + wrench
    to_centroid = body.middle - body.center
    about_centroid = moment - to_centroid.real * y + to_centroid.imag * x
    load = np.array([x, y, about_centroid / body.arm])
    tangents = (1j * contact.normals).view(np.float64).reshape(-1, 2)
    closure = balance_by_friction(tangents, forces, load, mu, levers)
    names, member = config.robot.member_names, points.member
    member_forces = np.bincount(member, forces, len(names))
    # A point in contact represents half a spacing to both sides.
    lengths = spacing * np.bincount(member, forces > 0.0, len(names))
    touched = np.flatnonzero(member_forces).tolist()
    utilisation = find_utilisation(tubes, forces * contact.normals)
    return GraspAnalysis(
        points=deformed.view(np.float64).reshape(-1, 2),
        members=member,
        places=places,
        gaps=contact.gaps,
        normals=contact.normals.view(np.float64).reshape(-1, 2),
        normal_forces=forces,
        friction_forces=closure.friction_forces,
        normal_wrench=normal_wrench,
        # Without contact the forces are in balance, but the object is not held.
        closed_by_friction=closure.closed and bool(touched),
        closure_residual=closure.residual,
        closure_tolerance=closure.tolerance,
        required_friction=closure.required_friction,
        closure_margin=closure.margin,
        contact_lengths={names[i]: float(lengths[i]) for i in touched},
        contact_forces={names[i]: float(member_forces[i]) for i in touched},
        utilisation=dict(zip(names, utilisation.tolist(), strict=True)),
    )


def _check_arguments(
    config: Configuration, body: ConvexObject, method: str, spacing: float
) -> float:
    """Check method, spacing and overlap, see `analyze_grasp`; return the spacing [m]."""
    checked_spacing = check_range(spacing, 'spacing', 'm', *SPACING_RANGE)
    if method not in METHODS:
        raise GraspError(f'method {method!r}: must be one of {", ".join(METHODS)}')
    depths = member_depths(config, body)
    # Linear statics describes small deflections.
    diameter, deepest = config.robot.description.tube_diameter, int(depths.argmax())
    if depths[deepest] > diameter:
        raise SolverError(
            f'member {config.robot.member_names[deepest]}: the object is '
            f'{1e3 * depths[deepest]:.3g} mm deep in it; must be at most {1e3 * diameter:.3g} mm, '
            'the diameter of the tube'
        )
    return checked_spacing


def _check_gains(gains: ArrayLike) -> RelaxationGains:
    """Return the checked gains of (9)."""
    checked = finite_array(gains, 3, 'gains K1 [N/m], K2 [-], K3 [1/m]', GraspError)
    if (checked < 0.0).any():
        raise GraspError(f'gains K1, K2, K3 {checked.tolist()}: must not be negative')
    return RelaxationGains(*checked.tolist())


def _sum_pressure(
    surface: Surface, deformed: Points, contact: ContactState
) -> tuple[Array, Array]:
    """Return the tubes' wrench (3,) on the object, and the lever arms (c,) of friction forces."""
    body, normals, push = surface.body, contact.normals, contact.forces * contact.normals
    # Points of the object's surface at which the forces act.
    feet = deformed - (contact.gaps + surface.margin) * normals
    force, moment = push.sum(), ((feet - body.center).conj() * push).imag.sum()
    levers = ((feet - body.middle) * normals.conj()).real / body.arm
    return -np.array([force.real, force.imag, moment]), levers
