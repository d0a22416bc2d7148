# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Surfaces that tubes meet: which side they face, and that frames do not matter."""

from isotruss_ros.core import ConvexObject, Disc, Ellipse, Polygon
from isotruss_ros.core.contact.surfaces import surface_of
import numpy as np
import pytest
from shapes import random_shape_of


@pytest.mark.parametrize('seed', range(5))
@pytest.mark.parametrize('kind', [Disc, Ellipse, Polygon])
def test_tubes_face_the_object_from_the_side_on_which_they_are(kind, seed):
    rng = np.random.default_rng(seed)
    body = ConvexObject(
        random_shape_of(kind, rng), (*rng.uniform(-1.0, 1.0, 2), rng.uniform(0.0, 6.0))
    )
    surface = surface_of(body, rng.uniform(0.0, 0.05))
    axis = np.exp(1j * rng.uniform(0.0, 6.0, 200))
    # Inside of the object, and out of it.
    away = (
        1.5 * surface.reach * rng.uniform(-1.0, 1.0, 200) * np.exp(1j * rng.uniform(0.0, 6.0, 200))
    )
    facing = surface.facing(away, axis)
    assert np.abs(facing) == pytest.approx(1.0)
    outward = 1j * axis * np.sign((away * axis.conj()).imag)
    assert ((facing * outward.conj()).real > 0.0).all()
    # Whichever way the tubes run, and the object and they are turned.
    assert surface.facing(away, -axis) == pytest.approx(facing, abs=1e-9)
    turn = np.exp(2.0j)
    turned = surface_of(body.moved_to([*body.pose[:2], body.pose.angle + 2.0]), 0.0)
    assert turned.facing(away * turn, axis * turn) == pytest.approx(
        surface_of(body, 0.0).facing(away, axis) * turn, abs=1e-9
    )
    # A tube that is far enough to be seen from where it is meets what is nearest to it.
    far = np.flatnonzero(np.abs((away * axis.conj()).imag) > 1.3 * surface.reach)
    assert len(far)
    assert facing[far] == pytest.approx(surface.nearest(away[far]).normals, abs=1e-9)
