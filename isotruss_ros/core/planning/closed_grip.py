# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A grip that presses on an object: what it does to tubes and object, and the bounds on it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
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


class ClosedGrip(NamedTuple):
    """
    A grip that presses on the object.

    :ivar config: configuration of the robot.
    :ivar body: the object where it lay, or where it went as the grip closed.
    :ivar analysis: of the object held fast.
    :ivar loads: the larger ones of an object held fast and of the free one.
    :ivar squeeze: mean normal force of the grasping members [N].
    :ivar slip_margin: see `SettledGrasp.slip_margin`: of the free object, zero where that would
        not be held; None where the grip does not fulfil the requirements [N].
    """

    config: Configuration
    body: ConvexObject
    analysis: GraspAnalysis
    loads: GraspLoads
    squeeze: float
    slip_margin: float | None


def grasp_loads(
    analysis: GraspAnalysis,
    normal_forces: Sequence[float] = (),
    utilisation: Sequence[float] = (),
) -> GraspLoads:
    """
    Return the loads of a grasp, the larger ones of an object held fast and of the free one.

    :param analysis: of the object held fast.
    :param normal_forces: (m,) of the members on the free object [N]; none where the ground holds
        it.
    :param utilisation: (n,) of members under the forces of the free object [-].
    """
    pressing = (*analysis.contact_forces.values(), *normal_forces)
    return GraspLoads(
        max(pressing, default=0.0),
        max(float(analysis.normal_forces.sum()), float(sum(normal_forces))),
        max([*analysis.utilisation.values(), *utilisation]),
    )


def exceeded_bound(needs: GraspRequirements, loads: GraspLoads) -> tuple[str, float, float] | None:
    """
    Return name, value and bound of the first one that a grasp exceeds; None if none.

    :param needs: what a grasp must fulfil.
    :param loads: of the grasp.
    """
    for name, value in loads._asdict().items():
        bound = getattr(needs, name)
        if value > bound:
            return name, value, bound
    return None
