# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robot with its kinematics, created from the description in a robot file."""

from __future__ import annotations

import functools
from pathlib import Path
import pickle

from isotruss_ros.core.errors import RobotFileError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.kinematics.home import place_home, require_determinate
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.model.description import RobotDescription
from isotruss_ros.core.model.robot_file import read_robot_file
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.records import Record
import numpy as np
from numpy.typing import ArrayLike


class Robot(
    Mechanism,
    Record,
    headline=('name', 'frame', 'member_names', 'roller_names'),
    data=('name', 'frame', 'node_names', 'member_names', 'roller_names', 'description'),
):
    """
    Isoperimetric truss robot, immutable.

    :ivar home: the `Configuration` at zero roller travel.
    :param description: content of a robot file, see `robot_file.read_robot_file`.
    :raises RobotFileError: the robot is not rigid or is overconstrained, a module does not fit, or
        parts overlap at home.
    """

    def __init__(self, description: RobotDescription) -> None:
        super().__init__(description)
        self._hash = hash((description.name, tuple(description.joints.items())))
        points = place_home(self)
        require_determinate(self, points)
        self.home_lengths = np.abs(self.constraints.spans(points))
        self.home = Configuration(self, np.zeros(len(self.topology.driven)), points)
        model = collision_model(self)
        distances = model.distances(self.home)
        closest = int(distances.argmin())
        if distances[closest] < 0.0:
            (parts,) = model.names(np.array([closest]))
            raise RobotFileError(
                f'{description.source}: {parts} overlap at home: their clearance is '
                f'{distances[closest]:.3f} m; must not be negative: move the joints apart, or use '
                f'smaller modules or a tube of less than {description.tube_diameter:g} m'
            )

    def __eq__(self, other: object) -> bool:
        """Return whether another robot has an equal description."""
        return type(other) is Robot and self.description == other.description

    def __hash__(self) -> int:
        """Return the hash of the name and the home of the robot."""
        return self._hash

    def __reduce__(self) -> tuple:
        """Return the arguments for unpickling, which creates one object for all equal robots."""
        return _made_of, (pickle.dumps(self.description),)

    @check_kinds
    def configuration(
        self, roller_positions: ArrayLike, near: Configuration | None = None
    ) -> Configuration:
        """
        Return the configuration at given roller travel (forward kinematics).

        Several configurations may exist; the result is the one that is reached continuously if the
        roller travel changes linearly from `near`.

        :param roller_positions: (r,) travel of the tube through each roller since home [m].
        :param near: configuration from which the result is reached; None: home. A close
            configuration saves time.
        :raises ConfigurationError: the roller travel has a wrong shape or is not finite, or no
            configuration exists at it.
        """
        return (near or self.home).moved_to(roller_positions)


@functools.lru_cache(maxsize=4)
def _made_of(description: bytes) -> Robot:
    return Robot(pickle.loads(description))


def load_robot(name_or_path: str | Path) -> Robot:
    """
    Return the robot of a preset or a robot file.

    :param name_or_path: name of a preset (`nine_member`, `triangle`), or path of a robot file.
    :raises RobotFileError: the robot file is invalid; the message names the file, the key, the
        value and the valid range.
    """
    return Robot(read_robot_file(name_or_path))
