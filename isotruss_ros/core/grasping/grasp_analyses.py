# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What the analysis of many grasps finds, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.grasping.analysis import GraspAnalysis
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices
import numpy as np


@dataclass(frozen=True, eq=False)
class GraspAnalyses:
    """
    What holds objects, and how well: n grasps of a robot with m members, see `GraspAnalysis`.

    :ivar errors: what `analyze_grasp` raised, by the number of the grasp; all numbers of these
        grasps are not a number, and their flag is False.
    :ivar force_closure: (n,) whether the object is touched, and friction balances the rest.
    :ivar closure_residual: (n,) what friction leaves, moments over d/2 [N].
    :ivar closure_tolerance: (n,) below which the residual counts as none [N].
    :ivar required_friction: (n,) smallest coefficient that closes; infinite if none does.
    :ivar closure_margin: (n,) largest extra wrench of any direction that friction still balances,
        moments over d/2 [N]; negative where the grasp is open.
    :ivar normal_wrench: (n, 3) (fx, fy, m) of the normal forces on the object [N, N m].
    :ivar contact_lengths: (n, m) length of tube in contact, zero where there is none [m].
    :ivar contact_spans: (n, m, 2) where contact begins and ends, from the member's start; not a
        number where there is none [m].
    :ivar contact_forces: (n, m) sum of the normal forces [N].
    :ivar utilisation: (n, m) largest bending moment over the wrinkling moment.
    :ivar utilisation_places: (n, m) where that is, from the member's start [m].
    :ivar stiffness: (n, 3, 3) wrench (fx, fy, m) that a displacement (dx, dy, dtheta) takes
        [N/m, N, N m].
    """

    errors: dict[int, IsotrussError]
    force_closure: Flags
    closure_residual: Array
    closure_tolerance: Array
    required_friction: Array
    closure_margin: Array
    normal_wrench: Array
    contact_lengths: Array
    contact_spans: Array
    contact_forces: Array
    utilisation: Array
    utilisation_places: Array
    stiffness: Array

    @classmethod
    def empty(cls, count: int, members: int) -> GraspAnalyses:
        """
        Return n analyses without numbers.

        :param count: n.
        :param members: m.
        """
        shapes = [(), (), (), (), (3,), (members,), (members, 2), *3 * [(members,)], (3, 3)]
        return cls(
            {},
            np.zeros(count, dtype=bool),
            *(np.full((count, *shape), np.nan) for shape in shapes),
        )

    def put(self, numbers: Indices, values: GraspAnalyses, which: Flags) -> None:
        """
        Fill in the numbers of some grasps.

        :param numbers: (k,) of these grasps.
        :param values: with the numbers of k grasps or more.
        :param which: which of these they are.
        """
        for field in fields(self)[1:]:
            getattr(self, field.name)[numbers] = getattr(values, field.name)[which]

    def put_one(self, number: int, analysis: GraspAnalysis, names: Sequence[str]) -> None:
        """
        Fill in the numbers of one grasp.

        :param number: of the grasp.
        :param analysis: of it.
        :param names: (m,) of the members.
        """
        for field in fields(self)[1:]:
            value = getattr(analysis, field.name)
            if isinstance(value, dict):
                none = (np.nan, np.nan) if field.name == 'contact_spans' else 0.0
                value = [value.get(name, none) for name in names]
            getattr(self, field.name)[number] = value
