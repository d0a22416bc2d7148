# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""A grip that holds the object, and the path on which it closes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.rigidity import rigidity_index
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.planning.force_bounds import GraspLoads
import numpy as np


@dataclass(frozen=True, eq=False)
class ClosedGrip:
    """
    A grip that holds the object; nothing in it is tied to a process.

    :ivar path: (k, r) roller positions from where all grasping members touch the object to the
        grasp [m].
    :ivar points: (n,) nodes in the grasp [m].
    :ivar rigidity: the least along the path, 1 at home.
    :ivar body: the object where it lay, or where it went as the grip closed.
    :ivar analysis: of the grasp, the object held fast.
    :ivar loads: of the grasp.
    :ivar squeeze: mean normal force of the grasping members [N].
    :ivar slip_margin: see `SettledGrasp.slip_margin`: of the free object; zero where that would
        not be held [N].
    """

    path: Array
    points: Points
    rigidity: float
    body: ConvexObject
    analysis: GraspAnalysis
    loads: GraspLoads
    squeeze: float
    slip_margin: float

    @classmethod
    def at_end(
        cls,
        path: Sequence[Configuration],
        body: ConvexObject,
        analysis: GraspAnalysis,
        loads: GraspLoads,
        squeeze: float,
        slip_margin: float,
    ) -> ClosedGrip:
        """
        Return the grip at the end of a path.

        :param path: configurations along it, at least one.
        :param body: see `ClosedGrip`, as are the others.
        :param analysis: of the grasp.
        :param loads: of the grasp.
        :param squeeze: [N].
        :param slip_margin: [N].
        """
        index = rigidity_index(path[0].robot)
        return cls(
            path=np.array([config.roller_positions for config in path]),
            points=path[-1].points,
            rigidity=min(float(index.modes(config).values[0]) for config in path),
            body=body,
            analysis=analysis,
            loads=loads,
            squeeze=squeeze,
            slip_margin=slip_margin,
        )
