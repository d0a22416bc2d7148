"""What the object is to do, as rows on the roller speeds: equation (19) without the nodes."""

from __future__ import annotations

from dataclasses import dataclass
import math

from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.grasp import Grasp, grasp_rows
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: A direction in which a unit of roller speed moves the object's surface less than this is lost.
RANK_TOLERANCE = 1e-5
#: A twist is out of reach when this share of it is.
REACH_TOLERANCE = 1e-9


def task_jacobian(config: Configuration, grasp: Grasp) -> Array:
    """
    Return the map from roller speeds to what they do to the grasped object.

    :return: (4, r): rows vx, vy [m/s], omega [rad/s] and opening rate of the grip [rad/s], for
        1 m/s at each roller.
    :raises GraspError: see `grasp_rows`.
    :raises ConfigurationError: the configuration is singular.
    """
    rows = grasp_rows(config, grasp)
    jacobian = config.module_rows(rows.nodes)
    jacobian[:, config.robot.module_names.index(grasp.module)] += rows.rolling
    return jacobian[:, config.robot.layout.driven]


@dataclass(frozen=True, eq=False)
class Reach:
    """
    The twists that the working rollers can bring about while the grip keeps its angle.

    Everything is in speeds of the object's surface, so that turning and moving compare.

    :ivar task: (3, w) rows vx, vy, omega d/2 on the speeds of the working rollers.
    :ivar grip: (1, w) row that keeps the grip; (0, w) where no roller moves it.
    :ivar directions: (k, 3) orthonormal: the twists that can be reached.
    :ivar radius: of the object [m].
    """

    task: Array
    grip: Array
    directions: Array
    radius: float

    @classmethod
    def of(cls, active: Array, radius: float) -> Reach:
        """
        Find out what can be reached.

        :param active: (4, w) columns of the task Jacobian that belong to working rollers.
        :param radius: of the object [m].
        """
        task = np.array([1.0, 1.0, radius])[:, None] * active[:3]
        grip = active[3] * radius
        square = float(grip @ grip)
        held = square > RANK_TOLERANCE**2
        keeping = task - np.outer(task @ grip, grip / square) if held else task
        basis, gains, _ = np.linalg.svd(keeping, full_matrices=False)
        kept = grip[None] if held else grip[None][:0]
        return cls(task, kept, basis[:, gains > RANK_TOLERANCE].T, radius)

    @property
    def rank(self) -> int:
        """Return how many independent twists can be reached."""
        return len(self.directions)


class Task:
    """
    The wanted twist cut down to what the working rollers can bring about.

    :param reach: what they can bring about.
    :param wanted: (3,) vx, vy [m/s], omega [rad/s], not zero.
    :ivar equality: (k, w) rows that the rollers must fulfil: reachable directions, then the grip.
    :ivar direction: (k,) unit vector of the nearest reachable twist in these rows.
    :ivar speed: its size [m/s], zero where nothing of the twist can be reached.
    :ivar reachable: whether it is the wanted twist.
    :ivar rank: how many of the rows are reachable directions.
    """

    def __init__(self, reach: Reach, wanted: Array) -> None:
        size = float(np.abs(wanted).max())
        # A twist of any finite size must not overflow.
        unit = np.array([1.0, 1.0, reach.radius]) * (wanted / size)
        nearest = reach.directions @ unit
        length = math.sqrt(nearest @ nearest)
        missed = reach.directions.T @ nearest - unit
        smallest = REACH_TOLERANCE * math.sqrt(unit @ unit)
        self.rank = reach.rank
        self.reachable = math.sqrt(missed @ missed) <= smallest
        self.speed = size * length if length > smallest else 0.0
        self.equality = np.vstack([reach.directions @ reach.task, reach.grip])
        self.direction = np.zeros(len(self.equality))
        if self.speed > 0.0:
            self.direction[: len(nearest)] = nearest / length
