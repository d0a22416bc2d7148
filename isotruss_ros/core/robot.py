"""The robot: what a robot file describes, ready to be posed."""

from __future__ import annotations

from pathlib import Path

from isotruss_ros.core.arrays import finite_array
from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.constraints import Constraints, Targets
from isotruss_ros.core.description import RobotDescription
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.home import place_home
from isotruss_ros.core.layout import make_layout
from isotruss_ros.core.rigidity import require_rigid
from isotruss_ros.core.robot_file import read_robot_file
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class Robot:
    """
    An isoperimetric truss robot; never changed after it is made.

    :ivar description: what the robot file says.
    :ivar layout: names and index arrays of joints, modules, members and rollers.
    :ivar constraints: the rows of equation (12).
    :ivar home: the `Configuration` at zero roller travel.
    :param description: see `robot_file.read_robot_file`.
    :raises RobotFileError: the robot is not rigid, over-supported, or a module does not fit.
    """

    def __init__(self, description: RobotDescription) -> None:
        self.description = description
        self.layout = make_layout(description)
        self.constraints = Constraints(self.layout)
        points = place_home(description, self.layout, self.constraints)
        require_rigid(description.source, self.layout, self.constraints.matrix(points))
        self.home_targets = Targets(
            self.constraints.lengths(points), points.view(np.float64)[self.layout.grounded]
        )
        self.home = Configuration(self, np.zeros(len(self.layout.driven)), points)

    @property
    def name(self) -> str:
        """Return the robot's name."""
        return self.description.name

    @property
    def frame(self) -> str:
        """Return the name of the coordinate frame in which the robot lives."""
        return self.description.frame

    @property
    def node_names(self) -> tuple[str, ...]:
        """Return the kinematic nodes' names: joints j, then t/j/B and t/j/C by module."""
        return self.layout.node_names

    @property
    def member_names(self) -> tuple[str, ...]:
        """Return the members' names t/j-k in module order."""
        return self.layout.member_names

    @property
    def module_names(self) -> tuple[str, ...]:
        """Return the modules' names t/j in the order of the robot file."""
        return self.layout.module_names

    @property
    def roller_names(self) -> tuple[str, ...]:
        """Return the driven modules' names, in the order of all roller arrays."""
        return self.layout.roller_names

    def configuration(
        self, roller_positions: ArrayLike, near: Configuration | None = None
    ) -> Configuration:
        """
        Return the configuration at given roller travel (forward kinematics).

        The shape is the one reached along the straight line of roller travel from `near`.

        :param roller_positions: (r,) travel of the tube through each roller since home [m].
        :param near: where to start; home when left out. A close one makes the call quick.
        :raises ConfigurationError: wrong shape, not finite, or no such configuration.
        """
        return (near or self.home).moved_to(roller_positions)

    def check_rollers(self, values: ArrayLike, what: str) -> Array:
        """
        Return a copy of one number for each roller.

        :param what: what the numbers are, for the message.
        :raises ConfigurationError: not (r,) finite numbers.
        """
        names = self.roller_names
        what = f'{what} for {", ".join(names)}'
        return finite_array(values, len(names), what, ConfigurationError)


def load_robot(name_or_path: str | Path) -> Robot:
    """
    Load a robot.

    :param name_or_path: the name of a preset (`nine_member`, `triangle`) or the path of a file.
    :raises RobotFileError: names the file, the key, the value and what would be right.
    """
    return Robot(read_robot_file(name_or_path))
