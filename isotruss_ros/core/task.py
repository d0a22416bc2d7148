"""What the object is to do, as rows on the roller speeds: equation (19) without the nodes."""

from __future__ import annotations

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

    Nodes follow the rollers by (12); the transposed solve needs one right-hand side for each row.

    :return: (4, r): rows vx, vy [m/s], omega [rad/s] and opening rate of the grip [rad/s], for
        1 m/s at each roller.
    :raises GraspError: see `grasp_rows`.
    :raises ConfigurationError: the configuration is singular.
    """
    layout = config.robot.layout
    rows = grasp_rows(config, grasp)
    by_length = config.factor.solve_transposed(rows.nodes.T)[: layout.n_modules]
    jacobian = (by_length - by_length[layout.previous]).T  # dL_i = dphi_i - dphi_following(i)
    module = config.robot.module_names.index(grasp.module)
    jacobian[:, module] += rows.rolling
    return jacobian[:, layout.driven]


class Task:
    """
    The wanted twist cut down to what the working rollers can bring about.

    Everything is in speeds of the object's surface, so that turning and moving compare.

    :ivar equality: (k, w) rows that the rollers must fulfil: reachable directions, then the grip.
    :ivar direction: (k,) unit vector of the nearest reachable twist in these rows.
    :ivar speed: its size [m/s], zero where nothing of the twist can be reached.
    :ivar reachable: whether it is the wanted twist.
    """

    def __init__(self, active: Array, radius: float, wanted: Array) -> None:
        surface = np.array([1.0, 1.0, radius])
        size = float(np.abs(wanted).max())
        unit = surface * (wanted / size)  # a twist of any finite size must not overflow
        grip = active[3] * radius
        task = surface[:, None] * active[:3]
        square = float(grip @ grip)
        held = square > RANK_TOLERANCE**2
        keeping = task - np.outer(task @ grip, grip / square) if held else task
        basis, gains, _ = np.linalg.svd(keeping, full_matrices=False)
        reached = basis[:, gains > RANK_TOLERANCE].T
        nearest = reached @ unit
        length = math.sqrt(nearest @ nearest)
        missed = reached.T @ nearest - unit
        smallest = REACH_TOLERANCE * math.sqrt(unit @ unit)
        self.reachable = math.sqrt(missed @ missed) <= smallest
        self.speed = size * length if length > smallest else 0.0
        self.equality = np.vstack([reached @ task, grip]) if held else reached @ task
        self.direction = np.zeros(len(self.equality))
        if self.speed > 0.0:
            self.direction[: len(nearest)] = nearest / length
