# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A grip that holds the object, and the path on which it closed."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.grasping.analysis import GraspAnalysis
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.objects import Cylinder
from isotruss_ros.core.planning.force_bounds import GraspLoads


@dataclass(frozen=True, eq=False)
class ClosedGrip:
    """
    A grip that holds the object.

    :ivar path: configurations from where all grasping members touch the object to the grasp.
    :ivar body: the object where it lay, or where it went as the grip closed.
    :ivar analysis: of the grasp, the object held fast.
    :ivar loads: of the grasp.
    :ivar squeeze: mean normal force of the grasping members [N].
    :ivar slip_margin: see `SettledGrasp.slip_margin`: of the free object; zero where that would
        not be held [N].
    """

    path: tuple[Configuration, ...]
    body: Cylinder | ConvexObject
    analysis: GraspAnalysis
    loads: GraspLoads
    squeeze: float
    slip_margin: float
