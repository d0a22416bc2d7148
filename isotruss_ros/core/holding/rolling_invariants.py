# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Rolling invariants of contacts, which are constant while the contacts roll.

They replace the conditions of friction if the contact history is known.
"""

from __future__ import annotations

from isotruss_ros.core.holding.contact_statics import ContactStatics, object_angles
from isotruss_ros.core.holding.pressed_contacts import ANGLE
from isotruss_ros.core.numerics.arrays import Array, Points
import numpy as np


def find_anchors(
    statics: ContactStatics, unknowns: Array, normals: Points, previous: Array
) -> Array:
    """
    Return the rolling invariants (k,), which are constant while the contacts roll [m].

    A_i = kappa_i (s_i - phi_i) - arc(arg nu_i - theta), where s_i is the position along the
    member, phi_i the travel of the tube, arc the arc length along the object's surface, nu_i
    the normal and theta the object's angle; kappa_i is -1 if the object is on the right of the
    member, otherwise 1. For `previous` see `object_angles`.
    """
    angles = object_angles(unknowns, normals, previous)
    arcs = statics.body.shape.unroll(angles, statics.contacts.corners)
    travel = statics.bent.structure.config.roller_positions
    rolled = (statics.anchor_rates @ travel[..., None])[..., 0]
    return rolled - statics.sides * unknowns[..., statics.places.feet] - arcs


def rolling_rows(statics: ContactStatics, unknowns: Array, normals: Points) -> Array:
    """Return the derivatives (k, 3 + 4k) of the rolling invariants by the unknowns."""
    indices, contacts = statics.places, np.arange(normals.shape[-1])
    in_object = normals * np.exp(-1j * unknowns[..., ANGLE, None])
    _, radii = statics.body.shape.surface_at(statics.contacts.corners, in_object)
    derivative = np.zeros((*normals.shape, indices.size))
    derivative[..., ANGLE] = radii
    derivative[..., contacts, indices.feet.start + contacts] = -statics.sides
    derivative[..., contacts, indices.inclinations.start + contacts] = -radii
    return derivative


def sticking(statics: ContactStatics, unknowns: Array, normals: Points) -> tuple[Array, Array]:
    """Return conditions of contacts that stick: zero residuals and `rolling_rows`."""
    return np.zeros(normals.shape), rolling_rows(statics, unknowns, normals)
