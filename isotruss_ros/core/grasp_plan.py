"""What the search for grasps finds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.grasp import Grasp
from isotruss_ros.core.grasp_analysis import GraspAnalysis
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Miss:
    """
    What keeps a candidate from being a grasp.

    :ivar requirement: its name.
    :ivar value: what the candidate has.
    :ivar bound: what it would need.
    :ivar distance: how far that is, in parts of what is usual, to compare candidates by.
    """

    requirement: str
    value: float
    bound: float
    distance: float


@dataclass(frozen=True, eq=False)
class PlannedGrasp:
    """
    A grasp that fulfils the requirements, and the way there.

    :ivar grasp: the module whose two sides hold the object, and the object.
    :ivar members: names `t/j-k` of all members that touch the object.
    :ivar config: where the robot is then.
    :ivar analysis: of the grasp, contact points 5 mm apart.
    :ivar score: of the measure asked for; larger is better.
    :ivar closure_margin: the least of all spacings looked at [N].
    :ivar required_friction: the largest of all spacings looked at.
    :ivar max_contact_force: largest sum of the normal forces of one member [N].
    :ivar total_force: sum of the normal forces [N].
    :ivar travel: length of the way of the roller that goes furthest [m].
    :ivar rigidity: the least on the way, against 1 at home.
    :ivar path: (k, r) roller positions from the present ones to the grasp, straight between [m].
    :ivar touch: the row of `path` at which all gripping sides touch the object: none does before.
    """

    grasp: Grasp
    members: tuple[str, ...]
    config: Configuration
    analysis: GraspAnalysis
    score: float
    closure_margin: float
    required_friction: float
    max_contact_force: float
    total_force: float
    travel: float
    rigidity: float
    path: Array
    touch: int

    @property
    def roller_positions(self) -> Array:
        """Return where the rollers are in the grasp, (r,) [m]."""
        return self.path[-1]


@dataclass(frozen=True, eq=False)
class GraspPlan(Sequence[PlannedGrasp]):
    """
    The answer of a search; as a sequence, its grasps.

    :ivar grasps: distinct ones, best first; empty where none was found.
    :ivar complete: whether the search came to its end, and was not stopped.
    :ivar nearest_miss: where none was found: what the nearest candidate misses.
    :ivar evaluations: configurations looked at, by kinematics or statics.
    :ivar analyses: of them, how many by statics.
    :ivar computing_time: [s].
    """

    grasps: tuple[PlannedGrasp, ...]
    complete: bool
    nearest_miss: Miss | None
    evaluations: int
    analyses: int
    computing_time: float

    def __getitem__(self, place: int | slice) -> PlannedGrasp | tuple[PlannedGrasp, ...]:
        """Return a grasp, or some of them."""
        return self.grasps[place]

    def __len__(self) -> int:
        """Return how many grasps were found."""
        return len(self.grasps)


@dataclass(frozen=True)
class Progress:
    """
    How far a search is.

    :ivar evaluations: configurations looked at so far.
    :ivar found: grasps so far.
    :ivar best: score of the best of them; None while there is none.
    :ivar share: of the candidates of all rounds that were looked at, 0 to 1.
    :ivar time_left: estimate [s]; None while there is none.
    """

    evaluations: int
    found: int
    best: float | None
    share: float
    time_left: float | None
