# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulation of a clamped tube with a cylinder pressed into its side, as in the paper's Fig. 6."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from isotruss_ros.core.contact.contact import solve_contact
from isotruss_ros.core.contact.contact_points import ContactPoints
from isotruss_ros.core.contact.flattening import flattening
from isotruss_ros.core.contact.refinement import measure_contact
from isotruss_ros.core.contact.surfaces import surface_of
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.statics.beam_column import local_stiffness
from isotruss_ros.core.statics.section import TubeStiffness
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
    surface = surface_of(body, 0.0 if flattens else tube.radius)
    radius = surface.reach
    reach = np.arange(-int(radius / CONTACT_SPACING) - 2, int(radius / CONTACT_SPACING) + 3)
    places = position + CONTACT_SPACING * reach
    places = places[(places > 0.0) & (places < tube.length)]
    points = _contact_points(tube, pressure, places, flattens)
    contact = solve_contact(points, surface)
    force = -float((contact.forces * contact.normals).imag.sum())
    return Pressed(force / depth, float(measure_contact(points, contact, 1).length[0]))


def _clamped_points(
    length: float, section: Sequence[float], places: Array
) -> tuple[Array, Array, Array]:
    """
    Return the shape functions and the compliance of points on a clamped beam.

    :param section: EA [N], EI [N m^2] and GA [N].
    :param places: (c,) increasing distances of the points from the start of the beam [m].
    :return: (c, 3, 6) derivatives of the displacements (ux, uy, theta) of each point with respect
        to those of start and end; and the compliances (c, c) along and across the beam [m/N].
    """
    # Each point divides the beam into two members with the stiffness (2).
    before, behind = (
        local_stiffness(part, *np.full((3, len(part)), np.reshape(section, (3, 1))))
        for part in (places, length - places)
    )
    own = np.linalg.inv(before[:, 3:, 3:] + behind[:, :3, :3])
    shapes = -own @ np.concatenate([before[:, 3:, :3], behind[:, :3, 3:]], axis=2)
    # N, V and M at the start due to a load determine the displacements up to the load.
    pull, shear, moment = -(before[:, :3, 3:] @ own).transpose(1, 2, 0)
    axial, flexural, sheared = section
    x = places[:, None]
    along = x / axial * pull[0]
    across = (x / sheared - x**3 / (6.0 * flexural)) * shear[1] + x**2 / (2.0 * flexural) * moment[
        1
    ]
    nearer = x <= places
    return shapes, np.where(nearer, along, along.T), np.where(nearer, across, across.T)


def _contact_points(
    tube: ClampedTube, pressure: float, places: Array, flattens: bool
) -> ContactPoints:
    """Return contact points inside one member with hinged or fixed ends."""
    only, length = np.zeros(len(places), dtype=np.intp), np.array([tube.length])
    section = tube.stiffness.section_stiffness(length, pressure)
    shapes, along, across = _clamped_points(
        tube.length, [float(each[0]) for each in section], places
    )
    inside = np.zeros((2, len(places), 2, len(places)))
    inside[0, :, 0], inside[1, :, 1] = along, across
    ends = np.zeros((6, 6))
    if tube.pinned:
        turns: tuple[Indices, ...] = np.ix_([2, 5], [2, 5])
        ends[turns] = np.linalg.inv(local_stiffness(length, *section)[0][turns])
    points = places.astype(np.complex128)
    skin, dents = points, np.zeros((len(places), len(places)))
    if flattens:
        kernel = flattening(
            tube.radius, pressure, tube.stiffness.fabric, local_stiffness=tube.local_stiffness
        )
        skin = points + 1j * kernel.radius
        dents = kernel.compliance(places, only, only, CONTACT_SPACING)
    inside[1, :, 1] += dents
    return ContactPoints(
        points=points,
        skin=skin,
        member=only,
        place=places,
        spacing=CONTACT_SPACING,
        axis=np.ones(len(places), dtype=np.complex128),
        inside=inside,
        spread=shapes[:, :2].swapaxes(0, 1),
        ends=ends,
        dents=dents,
    )
