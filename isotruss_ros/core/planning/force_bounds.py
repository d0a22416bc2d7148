# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What a grasp does to tubes and object, and the bounds on it."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.loaded_frame import held_utilisation
from isotruss_ros.core.planning.grasp_plan import Violation
from isotruss_ros.core.planning.requirements import GraspRequirements


class GraspLoads(NamedTuple):
    """
    What a grasp does to tubes and object.

    :ivar max_contact_force: largest normal force of one member [N].
    :ivar max_total_force: sum of the normal forces [N].
    :ivar max_utilisation: largest bending moment of a member over its wrinkling moment [-].
    """

    max_contact_force: float
    max_total_force: float
    max_utilisation: float


def grasp_loads(analysis: GraspAnalysis, grasp: HeldGrip | None = None) -> GraspLoads:
    """
    Return the loads of a grasp, the larger ones of an object held fast and of the free one.

    :param analysis: of the object held fast.
    :param grasp: how the free object is held; None for one that the ground holds.
    :raises StructureError: see `structure_of`.
    """
    forces, total = list(analysis.contact_forces.values()), float(analysis.normal_forces.sum())
    used = max(analysis.utilisation.values())
    if grasp is not None:
        forces += grasp.normal_forces.tolist()
        total = max(total, float(grasp.normal_forces.sum()))
        used = max(used, float(held_utilisation(grasp).max()))
    return GraspLoads(max(forces, default=0.0), total, used)


def exceeded_bound(needs: GraspRequirements, loads: GraspLoads) -> Violation | None:
    """
    Return the first bound on forces and bending moments that a grasp exceeds; None if none.

    :param needs: what a grasp must fulfil.
    :param loads: of the grasp.
    """
    for name, value in loads._asdict().items():
        bound = getattr(needs, name)
        if value > bound:
            return Violation(name, value, bound, 1.0 - bound / value)
    return None
