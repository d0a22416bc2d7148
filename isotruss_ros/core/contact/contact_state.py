# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""Where and how hard tubes touch an object: what solvers of (8) begin with, and find."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Points


@dataclass(frozen=True, eq=False)
class ContactState:
    """
    Where and how hard the object is touched.

    :ivar forces: (c,) normal forces, not negative [N].
    :ivar gaps: (c,) distances of the deformed tube from the surface, not negative [m].
    :ivar normals: (c,) unit normals of the surface, outward, x + iy.
    :ivar displacements: (c,) of what meets the object, see `ContactPoints.skin`, x + iy [m].
    :ivar radii: (c,) radius of curvature of the surface at the feet of the points [m].
    :ivar push: (c,) forces on the tubes, x + iy [N].
    """

    forces: Array
    gaps: Array
    normals: Points
    displacements: Points
    radii: Array
    push: Points


class ContactGuess(NamedTuple):
    """
    Where a search for the contact begins.

    :ivar forces: (c,) normal forces of a similar problem [N]; points with one are taken to touch.
    :ivar normals: (c,) unit normals of one, x + iy; None for those of the undeformed tubes.
    """

    forces: Array
    normals: Points | None = None
