# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Statics of a fixed object: contact forces, closure by friction and stiffness."""

from __future__ import annotations

from typing import Literal

from isotruss_ros.core.contact.contact import relax_contact, solve_contact
from isotruss_ros.core.contact.contact_points import (
    ContactPoints,
    ContactState,
    find_contact_points,
)
from isotruss_ros.core.contact.contact_regions import assess_members
from isotruss_ros.core.contact.flattening import flattening_of
from isotruss_ros.core.contact.friction_closure import balance_by_friction
from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis, SolvedContact
from isotruss_ros.core.contact.refinement import ContactSolver, measure_contact, refine_contact
from isotruss_ros.core.contact.sliding_contact import solve_sliding_contact, turn_at_corners
from isotruss_ros.core.contact.surfaces import Surface, surface_of
from isotruss_ros.core.errors import GraspError, SolverError
from isotruss_ros.core.kinematics.configuration import Configuration, require_configuration
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.model.check_load import check_load
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array, finite_array
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.statics.section import Pressure
from isotruss_ros.core.statics.structure import Structure, structure_of
import numpy as np
from numpy.typing import ArrayLike

#: Range of admissible spacings of contact points [m].
SPACING_RANGE = (1e-4, 0.1)
#: Largest overlap of an object with a member that has no contact force, in tube diameters [-].
#: Contact points miss such overlaps at a corner or at the end of a tube. A third of the value
#: refuses grasps with a slight contact of a third member.
MAX_FREE_OVERLAP = 0.05
#: Smallest number of contact points on an object other than a disc [-].
MIN_CONTACT_POINTS = 80


@single_threaded
def analyze_grasp(
    config: Configuration,
    body: ConvexObject,
    friction: float | None = None,
    external_wrench: ArrayLike = (0.0, 0.0, 0.0),
    method: Literal['exact', 'relaxation'] = 'exact',
    spacing: float = 0.005,
    pressure: Pressure | None = None,
    previous: GraspAnalysis | None = None,
    paper_model: bool = False,
) -> GraspAnalysis:
    """
    Compute contact forces (5) to (9), closure by friction (10) and stiffness of a fixed object.

    :param config: configuration of the robot, with rollers at rest.
    :param body: the object at its pose.
    :param friction: coefficient of friction between tube and object, not negative. If None, the
        coefficient of the object is used, or 0.5 if the object has none.
    :param external_wrench: (fx, fy, m) on the object about the origin of its frame [N, N m].
    :param method: 'exact' (the complementarity problem is solved by pivoting) or 'relaxation' (it
        is solved by the paper's iteration (9)). The relaxation supports flattening tubes only for
        discs.
    :param spacing: spacing of the contact points along the tubes [m]. Flattening tubes have points
        in contact regions only; in a short region the spacing is halved or quartered.
    :param pressure: gauge pressure [Pa], given as one number for all tubes, as one number for each
        tube in the order of the robot file, or as a mapping from tube names to pressures. If None,
        the pressure of the robot file is used.
    :param previous: analysis of a similar grasp, from which the iteration starts. If a deep
        indentation has several equilibria, this start decides which of them is found.
    :param paper_model: True for the paper's model: linear statics, straight tubes, round sections.
    :raises GraspError: an argument is invalid.
    :raises StructureError: the robot is a mechanism, a pressure is invalid, or the stiffness laws
        contradict each other.
    :raises SolverError: the contact problem was not solved, or the object overlaps a part of a
        member at which no contact is modelled.
    """
    require_configuration(config)
    mu, wrench = check_load(body, friction, external_wrench)
    (gap,) = finite_array([spacing], 1, 'spacing [m]', GraspError).tolist()
    if not SPACING_RANGE[0] <= gap <= SPACING_RANGE[1]:
        raise GraspError(
            f'spacing {spacing!r} m: must be from {SPACING_RANGE[0]} to {SPACING_RANGE[1]} m'
        )
    round_ = body.shape.is_round
    sliding = not (paper_model or round_)
    solver = _solver(method, sliding)
    structure = structure_of(config, pressure)
    margin = 0.5 * config.robot.description.tube_diameter if paper_model else 0.0
    surface = surface_of(body, margin)
    if paper_model:
        solved = _solve_straight(structure, surface, gap, solver, previous)
    else:
        kernel, before = flattening_of(config.robot, structure.pressures), None
        if previous is not None and previous.contact_spans:
            before = previous.solved
        budget = MIN_CONTACT_POINTS if sliding else None
        solved = refine_contact(structure, surface, gap, kernel, solver, before, budget)
    contact_points, found, *_, region_points = solved
    _require_touch(structure, body, contact_points, found)
    # Sliding tubes fold over corners.
    contact = turn_at_corners(contact_points, found, surface) if sliding else found
    solved = solved._replace(contact=contact)
    normals = contact.normals.view(np.float64).reshape(-1, 2)
    tangents = np.column_stack([-normals[:, 1], normals[:, 0]])
    pressed, levers = _pressed(body, contact_points, contact, margin, round_)
    load = _about_middle(body, pressed + wrench)
    closure = balance_by_friction(tangents, contact.forces, load, mu, levers)
    return GraspAnalysis(
        points=(contact_points.skin + contact.displacements)[region_points]
        .view(np.float64)
        .reshape(-1, 2),
        members=contact_points.member[region_points],
        places=contact_points.place[region_points],
        gaps=contact.gaps[region_points],
        normals=normals[region_points],
        normal_forces=contact.forces[region_points],
        friction_forces=closure.friction_forces[region_points],
        normal_wrench=pressed,
        # Without contact the forces are in balance, but the object is not held.
        closed_by_friction=closure.closed and bool((contact.forces > 0.0).any()),
        closure_residual=closure.residual,
        closure_tolerance=closure.tolerance,
        required_friction=closure.required_friction,
        closure_margin=closure.margin,
        center=body.center,
        structure=structure,
        solved=solved,
        **assess_members(structure, solved),
    )


def _require_touch(
    structure: Structure, body: ConvexObject, contact_points: ContactPoints, contact: ContactState
) -> None:
    """Raise SolverError if the object overlaps a member on which no contact force acts."""
    depths = member_depths(structure.config, body)
    free = MAX_FREE_OVERLAP * structure.config.robot.description.tube_diameter
    moved = max(float(np.abs(contact.displacements).max(initial=0.0)), free)
    pressing = np.bincount(contact_points.member, contact.forces, len(depths)) > 0.0
    missed = np.flatnonzero(~pressing & (depths > moved))
    if len(missed):
        deepest = int(missed[depths[missed].argmax()])
        raise SolverError(
            f'member {structure.config.robot.member_names[deepest]}: the object is '
            f'{1e3 * depths[deepest]:.3g} mm deep in it, beyond an end of its tube or behind its '
            'skin, where contact is not modelled; place the object elsewhere'
        )


def _solve_straight(
    structure: Structure,
    surface: Surface,
    spacing: float,
    solver: ContactSolver,
    previous: GraspAnalysis | None,
) -> SolvedContact:
    """Return the solved contact of tubes whose sections stay round."""
    points = find_contact_points(structure, surface, spacing)
    count, forces = len(points.points), None
    if previous is not None and len(previous.normal_forces) == count:
        forces = previous.normal_forces
    contact = solver(points, surface, forces)
    return measure_contact(points, contact, len(structure.config.robot.member_names))


def _solver(method: str, sliding: bool) -> ContactSolver:
    """Return the solver of (8) by a method; `sliding` is true for objects other than discs."""
    solvers: dict[str, ContactSolver] = {
        'exact': solve_sliding_contact if sliding else solve_contact,
        'relaxation': relax_contact,
    }
    if method not in solvers:
        raise GraspError(f'method {method!r}: must be one of {", ".join(solvers)}')
    if method == 'relaxation' and sliding:
        raise GraspError(
            "method 'relaxation': for flattening tubes (9) supports discs only; must be 'exact', "
            'or paper_model=True'
        )
    return solvers[method]


def _pressed(
    body: ConvexObject,
    contact_points: ContactPoints,
    contact: ContactState,
    margin: float,
    round_: bool,
) -> tuple[Array, Array]:
    """Return the tubes' wrench (3,) on the object, and the lever arms (c,) of friction forces."""
    if round_:
        force = contact.forces @ contact.normals
        return np.array([-force.real, -force.imag, 0.0]), np.ones(len(contact.forces))
    # Points of the object's surface at which the forces act, relative to its frame's origin.
    arms = contact_points.skin + contact.displacements - body.center
    arms = arms - (contact.gaps + margin) * contact.normals
    force, moment = contact.push.sum(), (arms.conj() * contact.push).imag.sum()
    levers = ((arms + body.center - body.middle) * contact.normals.conj()).real / body.arm
    return -np.array([force.real, force.imag, moment]), levers


def _about_middle(body: ConvexObject, wrench: Array) -> Array:
    """Return (fx, fy, m / arm) about the centroid [N] of a wrench about the frame's origin."""
    away = body.middle - body.center
    x, y, moment = wrench
    return np.array([x, y, (moment - away.real * y + away.imag * x) / body.arm])
