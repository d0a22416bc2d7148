# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulation of a clamped tube with a cylinder pressed into its side, as in the paper's Fig. 6."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.contact.pressed_skin import Flattening
from isotruss_ros.core.fixed_object.contact import ContactState, solve_contact
from isotruss_ros.core.fixed_object.contact_points import ContactPoints, Surface
from isotruss_ros.core.fixed_object.straight_compliance import clamped_pieces
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.statics.frame import local_stiffness
from isotruss_ros.core.statics.tube_stiffness import TubeStiffness
import numpy as np

#: Spacing of the contact points [m].
CONTACT_SPACING = 0.001


@dataclass(frozen=True)
class ClampedTube:
    """Straight tube with clamped ends, or with hinged ends if `pinned`."""

    stiffness: TubeStiffness  #: beam model with the constants of its wall
    radius: float  #: tube radius R [m]
    length: float  #: length between the clamps [m]
    local_stiffness: float = 1.0  #: ratio of the local stiffness to its theoretical value [-]
    pinned: bool = False  #: whether the ends are hinged instead of clamped


@dataclass(frozen=True)
class Pressed:
    """Force and contact of a tube with a cylinder pressed into its side."""

    stiffness: float  #: transverse force divided by depth [N/m]
    contact: float  #: length of the contact region along the tube [m]


def press(
    tube: ClampedTube,
    pressure: float,
    position: float,
    cylinder: float,
    depth: float,
    flattens: bool = True,
) -> Pressed:
    """
    Compute the contact (5) to (8) of a tube with a cylinder pressed into its side.

    :param tube: the tube.
    :param pressure: gauge pressure [Pa].
    :param position: position of the cylinder's centre along the tube [m].
    :param cylinder: diameter of the cylinder [m].
    :param depth: depth of the cylinder below the skin of the undeformed tube [m].
    :param flattens: whether the tube's section flattens. If not, its centre line is in contact
        with a disc that is enlarged by the tube radius, as in the paper.
    """
    center = complex(position, 0.5 * cylinder + tube.radius - depth)
    body = ConvexObject.disc((center.real, center.imag), cylinder)
    surface = Surface(body, 0.0 if flattens else tube.radius)
    radius = 0.5 * cylinder + surface.margin
    reach = np.arange(-int(radius / CONTACT_SPACING) - 2, int(radius / CONTACT_SPACING) + 3)
    places = position + CONTACT_SPACING * reach
    places = places[(places > 0.0) & (places < tube.length)]
    # Toward the centre line, because the skin may be beyond the centre of a small object.
    normals = surface.nearest(places).normals
    points, dent = _contact_points(tube, pressure, places, normals, flattens)
    contact = solve_contact(points, surface)
    force = -float((contact.forces * contact.normals).imag.sum())
    return Pressed(force / depth, _contact_length(contact, dent))


def _contact_length(contact: ContactState, dent: float) -> float:
    """Return the length of tube in contact [m]; `dent` is a point's own compliance [m/N]."""
    # The depth of the dent by each point's own load, minus its gap, is zero where contact ends. A
    # round tube has no dents, and a point in contact represents half a spacing to both sides.
    touching, depth = contact.forces > 0.0, dent * contact.forces - contact.gaps
    share = np.full(len(depth) - 1, 0.5)
    if dent:
        ends = touching[1:] != touching[:-1]
        inner = np.where(touching[1:], depth[1:], depth[:-1])[ends]
        outer = np.where(touching[1:], depth[:-1], depth[1:])[ends]
        share[ends] = inner / (inner - outer)
    sides = np.append(0.5, share) + np.append(share, 0.5)
    return CONTACT_SPACING * float(sides[touching].sum())


def _contact_points(
    tube: ClampedTube, pressure: float, places: Array, normals: Points, flattens: bool
) -> tuple[ContactPoints, float]:
    """Return points on the skin of a member, and the dent of a point by its own force [m/N]."""
    count, only = len(places), np.zeros(len(places), dtype=np.intp)
    length = np.array([tube.length])
    section = tube.stiffness.section_stiffness(length, pressure)
    whole, values = np.full(count, tube.length), np.repeat(np.array(section), count, axis=1)
    shapes, along, across = clamped_pieces(whole, values, places, np.zeros(count, dtype=bool))
    points, dent = places.astype(np.complex128), 0.0
    if flattens:
        kernel = Flattening(
            tube.radius, pressure, tube.stiffness.fabric, local_stiffness=tube.local_stiffness
        )
        points = points + 1j * kernel.radius
        dents = kernel.compliance(np.arange(count), CONTACT_SPACING)
        across, dent = across + dents, float(dents[0, 0])
    compliance = np.zeros((2, count, 2, count))
    compliance[0, :, 0], compliance[1, :, 1] = along, across
    compliance = compliance.reshape(2 * count, -1)
    if tube.pinned:
        turning = local_stiffness(length, *section)[0][[2, 5]][:, [2, 5]]
        turned = np.hstack([shapes.real, shapes.imag])[[2, 5]].T
        compliance += turned @ np.linalg.inv(turning) @ turned.T
    return ContactPoints(points, normals, only, compliance), dent
