# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Requirements that grasps must fulfil, and criteria by which grasps are ranked."""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import Enum
import math
from typing import TYPE_CHECKING

from isotruss_ros.core.errors import GraspError, quote
from isotruss_ros.core.model.convex_object import check_friction, DEFAULT_FRICTION
from isotruss_ros.core.model.obstacle import Obstacle, OBSTACLE_CLEARANCE
from isotruss_ros.core.numerics.argument_kinds import check_kind
from isotruss_ros.core.numerics.arrays import (
    finite_array,
    finite_rows,
    LARGEST_NUMBER,
    MAX_LOAD,
    MAX_MAGNITUDE,
)
from isotruss_ros.core.numerics.records import Record
from isotruss_ros.core.planning.violations import RequirementError
from isotruss_ros.core.statics.wrinkling import MAX_UTILISATION
import numpy as np

if TYPE_CHECKING:
    from isotruss_ros.core.planning.grasp_plan import ClosedGrip


class Measure(str, Enum):
    """Criteria by which grasps are ranked."""

    SLIP_MARGIN = 'slip_margin'  #: largest slip margin of the free object [N]
    TOTAL_FORCE = 'total_force'  #: smallest sum of normal forces [N]
    TRAVEL = 'travel'  #: shortest path of the rollers [m]
    STIFFNESS = 'stiffness'  #: largest stiffness of the object along `direction` [N/m]


@dataclass(frozen=True, repr=False)
class GraspRequirements(Record):
    """
    Requirements that a grasp of a free object must fulfil.

    The path `carry` is shifted so that it begins at the pose in which the object is held. A grasp
    is rejected if the object would slip on this path or not follow it, see `foresee_path`.

    :ivar friction: coefficient of friction, not negative [-].
    :ivar external_wrench: external wrench (fx, fy, m) on the object [N, N m].
    :ivar module: name `t/j` of the module at which the grasping members must meet; None: any
        module.
    :ivar members: names of the two or three required grasping members; None: any members.
    :ivar squeeze: required normal force of each member [N]; None: the search chooses it.
    :ivar min_slip_margin: smallest `SettledGrasp.slip_margin`, not negative [N].
    :ivar max_contact_force: largest normal force of a member [N].
    :ivar max_total_force: largest sum of the normal forces [N].
    :ivar max_utilisation: largest utilisation of a member [-].
    :ivar min_rigidity: smallest rigidity index along the path, 1 at home.
    :ivar min_length: smallest member length [m]; None: as in the robot file.
    :ivar max_length: largest member length [m]; None: as in the robot file.
    :ivar measure: criterion of the ranking.
    :ivar direction: displacement (x, y, angle) [m, rad] along which the stiffness is taken if
        `measure` is `STIFFNESS`.
    :ivar carry: poses (x, y, angle) along which the object is carried after the grasp [m, rad].
    :ivar obstacles: obstacles at rest, which robot and object do not touch.
    :ivar min_obstacle_clearance: smallest distance from obstacles along the path [m].
    :ivar count: number of distinct grasps, at least 1.
    :raises GraspError: a value is invalid.
    """

    friction: float = DEFAULT_FRICTION
    external_wrench: tuple[float, float, float] = (0.0, 0.0, 0.0)
    module: str | None = None
    members: tuple[str, ...] | None = None
    squeeze: float | None = None
    min_slip_margin: float = 0.0
    max_contact_force: float = math.inf
    max_total_force: float = math.inf
    max_utilisation: float = MAX_UTILISATION
    min_rigidity: float = 0.15
    min_length: float | None = None
    max_length: float | None = None
    measure: Measure = Measure.SLIP_MARGIN
    direction: tuple[float, float, float] = (0.0, 1.0, 0.0)
    carry: tuple[tuple[float, float, float], ...] = ()
    count: int = 3
    obstacles: tuple[Obstacle, ...] = ()
    min_obstacle_clearance: float = OBSTACLE_CLEARANCE

    def __post_init__(self) -> None:
        """Check the values; names are checked against the robot when a search begins."""
        for name, bound in ('external_wrench', MAX_LOAD), ('direction', LARGEST_NUMBER):
            what = f'requirement {name}'
            values = finite_array(getattr(self, name), 3, what, GraspError, bound)
            object.__setattr__(self, name, tuple(values.tolist()))
        for field in fields(self):
            name, value = field.name, getattr(self, field.name)
            is_optional = value is None and field.default is None
            if field.type not in ('float', 'float | None') or is_optional:
                continue
            must_be_finite = not name.startswith('max_') or name == 'max_length'
            is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
            if not is_number or not value >= 0.0 or (must_be_finite and math.isinf(value)):
                raise GraspError(
                    f'requirement {name}: {value!r}: must be a number, not negative'
                    + (', and finite' if must_be_finite else '')
                )
        check_friction(self.friction, 'requirement friction')
        check_kind('obstacles', self.obstacles, 'Sequence[Obstacle]')
        object.__setattr__(self, 'obstacles', tuple(self.obstacles))
        what = 'requirement carry, a list of poses (x, y, angle) [m, rad]'
        poses = finite_rows(self.carry, 3, what, GraspError, MAX_MAGNITUDE)
        object.__setattr__(self, 'carry', tuple(map(tuple, poses.tolist())))
        if self.members is not None:
            from isotruss_ros.core.manipulation.grip import check_member_names

            object.__setattr__(self, 'members', check_member_names(self.members))
            if self.module is not None:
                raise GraspError(
                    f'requirement module: {quote(self.module)}, and members '
                    f'{quote(repr(self.members))}: only one of the two can be required'
                )
        if self.squeeze == 0.0:
            raise GraspError('requirement squeeze: 0: must be positive, or omitted')
        if isinstance(self.count, bool) or not isinstance(self.count, int) or self.count < 1:
            raise GraspError(f'requirement count: {self.count!r}: must be 1 or more')
        try:
            object.__setattr__(self, 'measure', Measure(self.measure))
        except ValueError:
            raise GraspError(
                f'requirement measure: {quote(str(self.measure))}: must be one of '
                f'{", ".join(measure.value for measure in Measure)}'
            ) from None
        if self.measure is Measure.STIFFNESS and not any(self.direction):
            raise GraspError(
                'requirement direction: (0, 0, 0): must be the displacement for the stiffness'
            )

    def check_bounds(self, **values: float) -> None:
        """
        Raise RequirementError if a value violates its bound.

        :param values: values of a grasp by the names of the requirements, `min_...` or `max_...`.
        :raises RequirementError: a value is beyond its bound.
        """
        for name, value in values.items():
            bound = getattr(self, name)
            excess = value - bound if name.startswith('max_') else bound - value
            if excess > 0.0:
                raise RequirementError(name, float(value), bound)

    def rate_grip(self, grip: ClosedGrip, shortness: float) -> float:
        """
        Return the score of a grip; a larger score is better.

        :param grip: admissible grip.
        :param shortness: score if the criterion is the roller travel, larger for a shorter path.
        """
        if grip.chance is not None:
            return grip.chance.reliability
        if self.measure is Measure.TRAVEL:
            return shortness
        if self.measure is Measure.TOTAL_FORCE:
            return -float(grip.equilibrium.normal_forces.sum())
        if self.measure is Measure.STIFFNESS:
            along = np.array(self.direction) / np.linalg.norm(self.direction)
            response = grip.equilibrium.response
            return 0.0 if response is None else float(along @ response.stiffness @ along)
        return grip.slip_margin
