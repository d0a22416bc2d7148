# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Shapes that are similar to other shapes."""

from contracts import check_shape
from held_grips import APART, BOX, HOME
from isotruss_ros import core
from isotruss_ros.core.model.scaled_shape import ScaledShape
import numpy as np
import pytest

SHAPES = {
    'disc': core.Disc(0.3),
    'ellipse': core.Ellipse((0.2, 0.12)),
    'triangle': core.Polygon([(0.0, 0.0), (0.3, 0.0), (0.1, 0.2)], corner_radius=0.02),
}


@pytest.mark.parametrize('name', SHAPES)
def test_quantities_of_a_scaled_shape_agree_with_its_outline(name):
    check_shape(ScaledShape(SHAPES[name], 1.1), np.random.default_rng(1))


def test_a_scaled_box_has_the_contacts_of_the_box_with_scaled_corners():
    scaled = ScaledShape(BOX, 1.1)
    corners = (1.1 * np.array(BOX.vertices)).tolist()
    larger = core.Polygon(corners, corner_radius=1.1 * BOX.corner_radius)
    for angle in np.linspace(0.0, 6.0, 13):
        ends, expected = (s.contact_patch(np.exp(1j * angle), 0.05) for s in (scaled, larger))
        assert [end.corner for end in ends] == [end.corner for end in expected]
        assert [end.along for end in ends] == pytest.approx([end.along for end in expected])


def test_scaled_objects_settle_together_as_alone():
    body = core.place_between(HOME, APART, BOX, 0.4, 0.01).body
    bodies = [body.scaled(factor) for factor in (1.0, 0.98, 1.01)]
    together = core.settle_grasps(HOME, bodies, 0.9, members=APART)
    for i, scaled in enumerate(bodies):
        alone = core.settle_grasp(HOME, scaled, 0.9, members=APART)
        assert together.squeeze[i] == pytest.approx(alone.equilibrium.squeeze, rel=1e-10)
