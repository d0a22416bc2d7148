# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Lines of a held object for drawings: bent tubes, contact regions and contact forces."""

from __future__ import annotations

from isotruss_ros.core.holding.contact_search import bent_lines
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.numerics.arrays import Indices, Points
import numpy as np

#: Number of points on each member from guide ring to guide ring, and in each contact region [-].
POINTS_PER_MEMBER, POINTS_PER_REGION = 13, 9


def deformed_lines(grip: HeldGrip) -> Points:
    """Return points (m, s) on the members' centre lines, between their pinch points [m]."""
    config = grip.config
    length, ring = config.member_lengths, config.robot.description.module.guide_ring_distance
    between = ring + (length - 2.0 * ring)[:, None] * np.linspace(0.0, 1.0, POINTS_PER_MEMBER)
    places = np.column_stack([np.zeros_like(length), between, length])
    drawn = np.repeat(np.arange(len(places)), places.shape[1])
    return bent_lines(grip, drawn, places.ravel())[0].reshape(places.shape)


def region_lines(grip: HeldGrip) -> Points:
    """Return points (m, k) on the object's surface in the contact region of each member [m]."""
    start, end = grip.patches.spans.T[:, :, None]
    places = start + (end - start) * np.linspace(0.0, 1.0, POINTS_PER_REGION)
    members = np.repeat(grip.members[: len(places)], POINTS_PER_REGION)
    centers = bent_lines(grip, members, places.ravel())[0].reshape(places.shape)
    outward = sum_by_member(grip.contacts.owners, grip.state.normals)[: len(places), None]
    skins = centers - grip.statics.tube_radius * outward / np.abs(outward)
    nearest = grip.body.moved_to(grip.pose).nearest(skins.ravel())
    return skins - (nearest.gaps * nearest.normals).reshape(places.shape)


def force_lines(grip: HeldGrip, scale: float) -> Points:
    """
    Return tail and tip (m, 2) [m] of an arrow for the force of each grasping member on the object.

    The tips are at the centres of pressure; `scale` is the length of an arrow per force [m/N].
    """
    tips, forces = contact_resultants(grip)
    return np.stack([tips - scale * forces, tips], axis=1)


def contact_resultants(grip: HeldGrip) -> tuple[Points, Points]:
    """Return centre of pressure [m] and force on the object [N] of each grasping member, (m,)."""
    state, owners = grip.state, grip.contacts.owners
    forces = -(state.normal_forces + 1j * state.friction_forces) * state.normals
    moments = sum_by_member(owners, state.normal_forces * contact_points(grip))
    return moments / grip.normal_forces, sum_by_member(owners, forces)


def contact_points(grip: HeldGrip) -> Points:
    """Return the points (k,) of the object's surface at the contacts [m]."""
    body = grip.body.moved_to(grip.pose)
    own = grip.state.normals * body.turn.conjugate()
    return body.center + body.turn * body.shape.surface_at(grip.contacts.corners, own)[0]


def sum_by_member(owners: Indices, values: Points) -> Points:
    """Return the sums (m,) of values (k,) at the contacts of each member."""
    return np.bincount(owners, values.real) + 1j * np.bincount(owners, values.imag)
