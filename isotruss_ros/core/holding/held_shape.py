# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Bent robot with a held object: joint positions, lines for drawings, and lowest natural frequency.

A wrench on the object moves the object and the modules. The lowest natural frequency is taken over
the motions under all wrenches w (Rayleigh and Ritz):

    omega^2 = min over w of  w^T C w / (w^T M w),

with the compliance C of the held object, and the generalised mass M of the three motions under
unit wrenches. The result is an upper bound of the true frequency.
"""

from __future__ import annotations

import math

from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.samples import take
from isotruss_ros.core.statics.bent_tubes import find_load_changes
import numpy as np
import scipy.linalg

#: Number of points in each contact region [-].
POINTS_PER_REGION = 9


def region_lines(grip: HeldGrip) -> Points:
    """Return points (m, k) on the object's surface in the contact region of each member [m]."""
    start, end = grip.patches.spans.T[:, :, None]
    positions = start + (end - start) * np.linspace(0.0, 1.0, POINTS_PER_REGION)
    members = np.repeat(grip.members, POINTS_PER_REGION)
    centers = grip.bent_lines(members, positions.ravel())[0].reshape(positions.shape)
    normals = grip.contacts.sum_by_member(grip.state.normals)[:, None]
    # Points of the undented skin, then the points of the object's surface nearest to them.
    skin = centers - grip.samples.g.structure.tube_radius * normals / np.abs(normals)
    nearest = grip.body.nearest(skin.ravel())
    return skin - (nearest.gaps * nearest.normals).reshape(positions.shape)


def force_lines(grip: HeldGrip, scale: float) -> Points:
    """Return tail and tip (m, 2) of arrows for the forces on the object, at a scale [m/N]."""
    tips, forces = contact_resultants(grip)
    return np.stack([tips - scale * forces, tips], axis=1)


def contact_resultants(grip: HeldGrip) -> tuple[Points, Points]:
    """Return centre of pressure [m] and force on the object [N] of each grasping member, (m,)."""
    state, sum_by_member = grip.state, grip.contacts.sum_by_member
    forces = -(state.normal_forces + 1j * state.friction_forces) * state.normals
    moments = sum_by_member(state.normal_forces * contact_points(grip))
    return moments / grip.normal_forces, sum_by_member(forces)


def contact_points(grip: HeldGrip) -> Points:
    """Return the points (k,) of the object's surface at the contacts [m]."""
    body = grip.body
    local = grip.state.normals * body.turn.conjugate()
    return body.center + body.turn * body.shape.surface_at(grip.contacts.corners, local)[0]


@single_threaded
def held_joints(grip: HeldGrip) -> Array:
    """Return the positions (j, 2) of `Topology.joint_names`, displaced by contact forces [m]."""
    count = len(grip.config.robot.topology.joint_names)
    return grip.config.nodes[:count] + grip.displacements[:count, :2]


def lowest_frequency(grip: HeldGrip) -> float | None:
    """
    Return the lowest undamped natural frequency of a held object [rad/s]; contacts stick.

    A module's mass is at the midpoint of its pinch points, half of the mass of each piece of tube
    at each end of its member. None: a mass is unknown, or the equilibrium is neutral.
    """
    body, response = grip.body, grip.response
    if grip.config.robot.description.module.mass is None or body.mass is None or response is None:
        return None
    # Motions (3,) of the object under unit wrenches: of its frame, and of its centre of mass.
    x, y, angle = response.pose
    center = body.shape.centroid if body.center_of_mass is None else complex(*body.center_of_mass)
    center_motions = x + 1j * (y + body.turn * center * angle)
    inertia = body.mass * np.outer(center_motions.conj(), center_motions).real
    inertia += body.mass * body.shape.gyration**2 * np.outer(angle, angle)
    inertia += _inertia_of_robot(grip)
    compliance = response.pose * np.array([[1.0], [1.0], [grip.arm]])
    symmetric = 0.5 * (compliance + compliance.T)
    squares = scipy.linalg.eigvalsh(symmetric, inertia, check_finite=False)
    return math.sqrt(squares[0]) if squares[0] > 0.0 else None


def _inertia_of_robot(grip: HeldGrip) -> Array:
    """Return the generalised mass (3, 3) of modules and tubes for unit wrenches."""
    description, topology = grip.config.robot.description, grip.config.robot.topology
    linear = grip.alone.linear
    loads = linear.load_rates(grip.response.change[None])[0].reshape(-1, 3, 3)
    bent = take(linear.tubes.activated(), 0)
    nodes = find_load_changes(bent, loads, np.zeros((len(loads), 3))).nodes
    # Motions of pinch points B and C, where the tube pieces BD and CE of the modules start.
    piece_starts = bent.structure.frame.layout.start[bent.structure.pieces]
    b, c, _ = (nodes[:, 0] + 1j * nodes[:, 1])[piece_starts]
    # A member runs from B of its module to C of the following module.
    half_masses = 0.5 * description.mass_per_length * grip.config.member_lengths
    module_masses = np.full(len(b), description.module.mass)
    masses = np.concatenate([module_masses, half_masses, half_masses[topology.previous]])
    motions = np.concatenate([0.5 * (b + c), b, c])
    return ((motions.conj().T * masses) @ motions).real
