"""One candidate of the search for grasps, from the open grip to the grasp; made to be sent."""

from __future__ import annotations

from dataclasses import dataclass
import functools
import pickle

from isotruss_ros.core.approach import Approach
from isotruss_ros.core.closing import Closing
from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.grasp_analysis import GraspAnalysis
from isotruss_ros.core.grasp_plan import Miss
from isotruss_ros.core.requirements import GraspRequirements, Measure
from isotruss_ros.core.robot import Robot
from isotruss_ros.core.shape_margins import shape_margins
from isotruss_ros.core.squeeze import Pressed, Squeeze
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Candidate:
    """
    An open grip that is to be squeezed; nothing in it is tied to a process.

    :ivar robot: the pickled description of the robot.
    :ivar positions: (r,) roller positions of the open grip [m].
    :ivar points: (n,) its nodes [m].
    :ivar closing: what closes.
    :ivar requirements: what the grasp is to fulfil.
    """

    robot: bytes
    positions: Array
    points: NDArray[np.complex128]
    closing: Closing
    requirements: GraspRequirements


@dataclass(frozen=True, eq=False)
class Squeezed:
    """
    What became of a candidate.

    :ivar positions: (k, r) roller positions from the touch to the grasp [m]; none if it is none.
    :ivar points: (n,) nodes in the grasp [m].
    :ivar analyses: of the grasp, with each spacing of the contact points.
    :ivar rigidity: the least from the touch to the grasp.
    :ivar miss: what it misses; None if it is a grasp.
    :ivar looked_at: configurations that were computed.
    :ivar analysed: analyses.
    """

    positions: Array
    points: NDArray[np.complex128]
    analyses: tuple[GraspAnalysis, ...]
    rigidity: float
    miss: Miss | None
    looked_at: int
    analysed: int

    def score(self, requirements: GraspRequirements, travel: float) -> float:
        """
        Return what the measure makes of the grasp; larger is better.

        :param travel: of the whole way [m].
        """
        if requirements.measure is Measure.TRAVEL:
            return -travel
        if requirements.measure is Measure.TOTAL_FORCE:
            return -max(float(one.normal_forces.sum()) for one in self.analyses)
        if requirements.measure is Measure.STIFFNESS:
            along = np.array(requirements.direction) / np.linalg.norm(requirements.direction)
            return min(float(along @ one.stiffness @ along) for one in self.analyses)
        return min(one.closure_margin for one in self.analyses)


def make_candidate(approached: Approach, requirements: GraspRequirements) -> Candidate:
    """Turn an open grip into something that can be sent to another process."""
    config = approached.path[-1]
    description = pickle.dumps(config.robot.description)
    return Candidate(
        description, config.roller_positions, config.points, approached.closing, requirements
    )


def squeeze_candidate(candidate: Candidate) -> Squeezed:
    """Find out how hard the sides of a candidate must press, in whichever process."""
    robot = _robot(candidate.robot)
    opened = Configuration(robot, candidate.positions, candidate.points)
    search = Squeeze(opened, candidate.closing, candidate.requirements)
    pressed: Pressed | None = None
    way: tuple[Configuration, ...] = ()
    try:
        pressed = search.search()
        way = search.way(pressed) if pressed is not None else ()
    except IsotrussError as error:
        # A candidate that cannot be computed is none; what was found out before still counts.
        search.nearest = search.nearest or Miss(str(error), 0.0, 0.0, 100.0)
    if pressed is None or not way:
        nothing = np.empty((0, len(candidate.positions)))
        miss = search.nearest or Miss('path', 0.0, 1.0, 60.0)
        return Squeezed(nothing, opened.points, (), 0.0, miss, search.looked_at, search.analyses)
    return Squeezed(
        np.array([config.roller_positions for config in way]),
        pressed.config.points,
        pressed.analyses,
        min(shape_margins(config).rigidity for config in way),
        None,
        search.looked_at,
        search.analyses,
    )


@functools.lru_cache(maxsize=4)
def _robot(description: bytes) -> Robot:
    return Robot(pickle.loads(description))
