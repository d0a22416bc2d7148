# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contacts of a held object: members, corners, forces, and contact patches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import functools
from typing import ClassVar, NamedTuple

from isotruss_ros.core.contact.pressed_skin import PressedSkin
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject, facing_normals
from isotruss_ros.core.model.object_samples import ObjectSamples
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.numerics.samples import column
from isotruss_ros.core.statics.blocks import Layout
from isotruss_ros.core.statics.structure import ConfigurationSamples
import numpy as np

# Contacts of an object with members, and pose and forces of the object at these contacts.
#
# A corner has one contact; a face has one contact at each end.

#: Indices of the pose among the unknowns.
CENTER, ANGLE, POSE = slice(0, 2), 2, 3


@dataclass(frozen=True, eq=False)
class PressedContacts:
    """The k contacts of an object, in ascending order of their members."""

    members: Indices  #: (k,) indices of the members
    corners: Indices  #: (k,) index of the polygon's corner of each contact; zero for other shapes

    @functools.cached_property
    def owners(self) -> Indices:
        """Return the grasping member (k,) of each contact, numbered 0, 1 or 2 within the grip."""
        members = self.members.tolist()  # for few contacts, lists are faster
        distinct = list(dict.fromkeys(members))
        return np.array([distinct.index(member) for member in members])

    @functools.cached_property
    def key(self) -> tuple[bytes, bytes]:
        """Return a hashable value that is equal for equal contacts."""
        return self.members.tobytes(), self.corners.tobytes()

    @functools.cached_property
    def owner_key(self) -> tuple[int, ...]:
        """Return `owners` as a hashable value."""
        return tuple(self.owners.tolist())

    @functools.cached_property
    def by_member(self) -> list[Indices]:
        """Return the contacts of each grasping member: one, or two at the ends of a face."""
        return group_by_member(self.owners)

    @functools.cached_property
    def member_starts(self) -> Indices:
        """Return the index (m,) of the first contact of each grasping member."""
        members = self.members.tolist()
        return np.array([members.index(member) for member in dict.fromkeys(members)])

    @property
    def at_faces(self) -> Flags:
        """Return a mask (k,) of the contacts whose member lies on a flat face of the object."""
        return np.bincount(self.owners)[self.owners] > 1

    def sum_by_member(self, values: Array, axis: int = 0) -> Array:
        """Return the sums (m, ...) of values (k, ...) at the contacts of each grasping member."""
        return np.add.reduceat(values, self.member_starts, axis=axis)


def group_by_member(owners: Indices) -> list[Indices]:
    """Return the contacts of each grasping member by the `owners` (k,) of the contacts."""
    return [np.flatnonzero(owners == member) for member in range(owners[-1] + 1)]


class Places(NamedTuple):
    """
    Indices of the unknowns and of the equations of k contacts.

    The first equations are touch along and across the member and in inclination, by contact.
    """

    feet: slice  #: positions along the members
    turns: list[int]  #: angle of the object, and inclinations
    inclinations: slice  #: inclinations of the bent tubes
    normal: slice  #: normal forces
    friction: slice  #: friction forces
    forces: slice  #: normal and friction forces
    causes: slice  #: inclinations, normal and friction forces
    balance: slice  #: equations for the balance of fx, fy and m
    conditions: slice  #: equations of friction or rolling, see `ContactConditions`
    size: int  #: number of unknowns

    @classmethod
    @functools.lru_cache(maxsize=16)
    def of(cls, count: int) -> Places:
        """Return the indices of unknowns and equations for a number of contacts."""
        begins = [POSE + i * count for i in range(5)]
        bounds = (0, 1), (1, 2), (2, 3), (3, 4), (2, 4), (1, 4)
        unknowns = [slice(begins[first], begins[end]) for first, end in bounds]
        rows = slice(3 * count, 3 * count + 3), slice(3 * count + 3, None)
        turns = [ANGLE, *range(begins[1], begins[2])]
        return cls(unknowns[0], turns, *unknowns[1:], *rows, 4 * count + 3)  # type: ignore


@dataclass(frozen=True, eq=False)
class ContactForces:
    """
    Pose, contacts and forces of an object at k contacts.

    The unknowns (3 + 4k,) are the pose x, y [m], angle [rad]; distances s_i of the contacts from
    the members' starts [m]; inclinations beta_i of the bent tubes relative to the straight members
    [rad]; normal forces N_i; and friction forces T_i on the tubes, counter-clockwise around the
    object [N].

    Of n samples, all arrays have the samples as their first axis.
    """

    shared: ClassVar[tuple[str, ...]] = ('places',)
    unknowns: Array
    normals: Points  #: (k,) unit normals from the object toward the tubes
    loads: Array  #: (k, 3) forces along and across the members [N], and moments on tubes [N m]
    jacobian: Array  #: derivatives of the equilibrium equations by the unknowns

    @functools.cached_property
    def places(self) -> Places:
        """Return the indices of the unknowns and of the equations."""
        return Places.of(self.normals.shape[-1])

    @functools.cached_property
    def feet(self) -> Array:
        """Return the positions of the contacts along the members, (k,) [m]."""
        return self.unknowns[..., self.places.feet]

    @functools.cached_property
    def normal_forces(self) -> Array:
        """Return the normal forces (k,) at the contacts [N], positive in compression."""
        return self.unknowns[..., self.places.normal]

    @functools.cached_property
    def friction_forces(self) -> Array:
        """Return the friction forces (k,) on the tubes, counter-clockwise round the object [N]."""
        return self.unknowns[..., self.places.friction]

    @property
    def forces(self) -> Array:
        """Return the normal and then the friction forces at the contacts, (2k,) [N]."""
        return self.unknowns[..., self.places.forces]


def find_pressed(
    configs: Configuration | ConfigurationSamples,
    bodies: ConvexObject | ObjectSamples,
    members: Mapping[int, Indices],
    shapes: Sequence[Shape],
) -> dict[int, PressedContacts]:
    """Return contacts of some of n shapes with their members, see `Shape.contact_patch`."""
    every = np.arange(len(configs.robot.topology.b))
    starts, normals = facing_lines(configs, bodies, every)
    radius = 0.5 * configs.robot.description.tube_diameter
    in_object = normals * column(bodies.turn).conj()
    skin_heights = ((starts - column(bodies.center)) * normals.conj()).real - radius
    columns = (np.atleast_2d(values).tolist() for values in (in_object, skin_heights))
    lines = list(zip(*columns, strict=True))
    pressed = {}
    for i, of_object in members.items():
        (in_one, heights), contacts = lines[i], list[tuple[int, int]]()
        for member in of_object.tolist():
            patch = shapes[i].contact_patch(in_one[member], radius, heights[member])
            contacts += [(member, end.corner) for end in patch]
        pressed[i] = PressedContacts(*np.array(contacts).T)
    return pressed


def facing_lines(
    config: Configuration | ConfigurationSamples,
    body: ConvexObject | ObjectSamples,
    members: Indices,
) -> tuple[Points, Points]:
    """Return the starts (m,) of members [m], and their normals (m,) away from an object."""
    starts = config.points[..., config.robot.topology.b[members]]
    axes = config.member_axes[..., members]
    return starts, facing_normals(column(body.middle), starts, axes)


# Contact patches of a held object: lengths, widths, areas and pressures on the skin of the tubes.
#
# The wall of a flattened section is straight across the tube. Along the tube it has the tension T
# and follows the object with the curvature k. So the contact pressure is p + T k with the gauge
# pressure p, and the width of the contact is the load per length over this pressure. The width is
# at most half of the tube's circumference, pi R; then the section is flat, and the pressure is
# higher.


class ContactPatches(NamedTuple):
    """Contact patches on the m grasping members."""

    spans: Array  #: (m, 2) first and last point in contact, from the member's start [m]
    lengths: Array  #: (m,) length of tube in contact [m]
    widths: Array  #: (m,) largest width around the tube [m]
    areas: Array  #: (m,) area of contact [m^2]
    pressures: Array  #: (m,) mean contact pressure [Pa]
    peaks: Array  #: (m,) largest contact pressure [Pa]
    flattened: Flags  #: (m,) whether a section is flat, so that the model of the dents is invalid


def find_patches(
    contacts: PressedContacts,
    state: ContactForces,
    config: Configuration,
    pressures: Array,
    layout: Layout,
    directions: Array,
    end_forces: tuple[Array, Array],
    skins: PressedSkin,
) -> ContactPatches:
    """
    Return the contact patches of an object in equilibrium.

    For `end_forces` see `BentTubes.end_forces`, for `skins` see `Dents.press`.
    """
    radius = 0.5 * config.robot.description.tube_diameter
    gauge = pressures[config.robot.topology.tube[contacts.members]]
    tension = _wall_tension(state, layout, directions, end_forces[0], gauge, radius)
    spacing, is_pressed = column(skins.spacing), skins.forces > 0.0
    # Curvature of the object's surface, zero at the ends and where the surface is hollow.
    curvature = np.zeros(skins.heights.shape)
    curvature[:, 1:-1] = np.maximum(np.diff(skins.heights, 2) / spacing**2, 0.0)
    # Pressures of a round section, by the equilibrium of its wall. The section is flat if a
    # contact over half of its circumference needs a higher pressure to carry the loads.
    round_pressures = gauge[:, None] + tension[:, None] * curvature
    loads = skins.forces / spacing
    flat_pressures = loads / (np.pi * radius)
    pressures = np.maximum(round_pressures, flat_pressures)
    widths = loads / pressures
    positions = state.feet[:, None] - np.sign(state.loads[:, 1:2]) * skins.positions
    begins = np.where(is_pressed, positions, np.inf).min(axis=1) - 0.5 * skins.spacing
    ends = np.where(is_pressed, positions, -np.inf).max(axis=1) + 0.5 * skins.spacing
    # Length, area and force of each contact; its largest width and pressure, and flatness.
    sums = is_pressed.sum(axis=1), widths.sum(axis=1), loads.sum(axis=1)
    peaks = np.where(is_pressed, pressures, 0.0).max(axis=1)
    maxima = widths.max(axis=1), peaks, (flat_pressures >= round_pressures).any(axis=1)
    starts = contacts.member_starts
    spans = [np.minimum.reduceat(begins, starts), np.maximum.reduceat(ends, starts)]
    lengths, areas, forces = contacts.sum_by_member(skins.spacing * np.array(sums), axis=1)
    max_widths, peaks, flattened = np.maximum.reduceat(np.array(maxima), starts, axis=1)
    return ContactPatches(
        np.stack(spans, axis=1), lengths, max_widths, areas, forces / areas, peaks, flattened > 0.0
    )


def _wall_tension(
    state: ContactForces,
    layout: Layout,
    directions: Array,
    end_forces: Array,
    gauge: Array,
    radius: float,
) -> Array:
    """Return the tension (k,) along the tube in its wall on the object's side [N/m]."""
    # Columns of `FrameState.end_forces`: along, across and moment at the start and at the end.
    before = end_forces[layout.before]
    behind = end_forces[layout.behind]
    # Bending away from the object's force stretches the wall on the object's side. Friction acts
    # at the skin, so the moment differs before and behind the contact.
    moment = 0.5 * directions * (before[:, 5] - behind[:, 2])
    compression = np.maximum(-before[:, 3], behind[:, 0])
    bending_pull = 2.0 / radius * moment * np.sign(state.loads[:, 1])
    wall_pull = gauge * np.pi * radius**2 + bending_pull - compression
    return np.maximum(wall_pull / (2.0 * np.pi * radius), 0.0)
