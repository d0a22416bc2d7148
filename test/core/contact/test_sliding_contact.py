# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tubes that slide along themselves: what is turned where points cannot tell a corner."""

from dataclasses import replace

from comparison.wedge import pressed_into
from isotruss_ros.core import Ellipse, load_robot, Polygon
from isotruss_ros.core.contact.contact_points import find_contact_points
from isotruss_ros.core.contact.flattening import flattening_of
from isotruss_ros.core.contact.sliding_contact import solve_sliding_contact, turn_at_corners
from isotruss_ros.core.contact.surfaces import surface_of
from isotruss_ros.core.statics.structure import structure_of
import numpy as np
import pytest

HOME = load_robot('nine_member').home
SPACING = 0.005
CORNERS = [(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)]


@pytest.mark.parametrize(
    ('shape', 'angle', 'least'),
    [
        (Polygon(CORNERS), 0.4, 0.0),
        (Polygon(CORNERS, 0.03), 0.4, 0.1),
        (Polygon(CORNERS, 1.9 * SPACING), 0.4, 0.0),
        (Polygon(CORNERS, 2.1 * SPACING), 0.4, 0.01),
        (Ellipse((0.1, 0.05)), 1.8, 1.0),
    ],
)
def test_normals_are_limited_except_on_resolved_arcs(shape, angle, least):
    held, fold = pressed_into(HOME, 'south/P', shape, angle, 0.02), np.deg2rad(12.0)
    surface, structure = surface_of(held), structure_of(HOME)
    kernel = flattening_of(HOME.robot, structure.pressures)
    points = find_contact_points(structure, surface, SPACING, kernel)
    contact = solve_sliding_contact(points, surface.resolved(SPACING))
    # However weak it is.
    contact = replace(contact, forces=1e-3 * contact.forces, push=1e-3 * contact.push)
    turned = turn_at_corners(points, contact, surface)
    sizes = np.abs(contact.push)
    pressing = sizes > 0.0
    radii = held.nearest(points.skin + contact.displacements).radii
    arcs = pressing & np.isfinite(radii) & (radii >= 2.0 * SPACING)
    assert arcs.sum() >= least * pressing.sum()
    assert arcs.any() == (least > 0.0)
    leans = np.angle(turned.normals * contact.push.conj())
    before = np.angle(contact.normals * contact.push.conj())
    # Somewhere it matters.
    assert np.abs(before[pressing]).max() > 1.5 * fold
    assert np.array_equal(turned.normals[arcs], contact.normals[arcs])
    assert np.array_equal(turned.forces[arcs], contact.forces[arcs])
    faces = pressing & ~arcs
    assert leans[faces] == pytest.approx(np.clip(before[faces], -fold, fold), abs=1e-12)
    for normals in (contact.normals, turned.normals):
        assert np.abs(normals) == pytest.approx(1.0)
    # Across the tubes they press as before.
    assert (turned.forces * np.cos(leans))[faces] == pytest.approx(sizes[faces], rel=1e-9)
