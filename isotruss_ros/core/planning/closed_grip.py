# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A grip that presses on an object: what it does to tubes and object, and what it is worth."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.planning.grasp_plan import RequirementError
from isotruss_ros.core.planning.requirements import GraspRequirements, Measure
import numpy as np

#: Members close by so much from waypoint to waypoint, in diameters of the tube; ...
CLOSING_STEP = 0.12
#: ... steps become shorter by this factor where a bound ends them, while longer than this share.
REFINEMENT, LEAST_SHARE = 0.34, 0.3


class ClosedGrip(NamedTuple):
    """
    A grip that presses on the object.

    Its slip margin is zero where the free object would not be held, None where the grip does not
    fulfil the requirements; see `SettledGrasp.slip_margin`.
    """

    config: Configuration  #: configuration of the robot
    body: ConvexObject  #: the object where it lay, or where it went as the grip closed
    analysis: GraspAnalysis  #: of the object held fast
    loads: dict[str, float]  #: see `find_loads`
    squeeze: float  #: mean normal force of the grasping members [N]
    slip_margin: float | None  #: of the free object [N], see above


def find_loads(
    needs: GraspRequirements,
    analysis: GraspAnalysis,
    normal_forces: Array,
    utilisation: Array,
) -> dict[str, float]:
    """
    Return the loads of a grasp by requirement, the larger ones of an object held fast and free.

    These are the largest normal force of one member [N], the sum of all [N], and the largest
    bending moment of a member over its wrinkling moment [-].

    :param needs: with a bound for each.
    :param analysis: of the object held fast.
    :param normal_forces: (m,) of the members on the free object [N]; none where the ground holds
        it.
    :param utilisation: (n,) of members under the forces of the free object [-].
    :raises RequirementError: one exceeds its bound.
    """
    pressing = (*analysis.contact_forces.values(), *normal_forces)
    loads = {
        'max_contact_force': float(max(pressing, default=0.0)),
        'max_total_force': float(max(analysis.normal_forces.sum(), sum(normal_forces))),
        'max_utilisation': float(max([*analysis.utilisation.values(), *utilisation])),
    }
    for name, value in loads.items():
        bound = getattr(needs, name)
        if value > bound:
            raise RequirementError(name, value, bound, 1.0 - bound / value)
    return loads


def rate_grip(needs: GraspRequirements, grip: ClosedGrip, shortness: float) -> float:
    """
    Return the score of a grip by the measure; larger is better.

    :param needs: the requirements, with the measure.
    :param grip: one that fulfils them.
    :param shortness: the larger, the shorter is the path.
    """
    if needs.measure is Measure.TRAVEL:
        return shortness
    if needs.measure is Measure.TOTAL_FORCE:
        return -grip.loads['max_total_force']
    if needs.measure is Measure.STIFFNESS:
        along = np.array(needs.direction) / np.linalg.norm(needs.direction)
        return float(along @ grip.analysis.stiffness @ along)
    if needs.measure is Measure.CLOSURE_MARGIN:
        return grip.analysis.closure_margin
    return grip.slip_margin
