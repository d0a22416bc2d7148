# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Data of a robot that do not depend on the robot's configuration."""

from __future__ import annotations

from typing import Any

from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.kinematics.constraints import Constraints
from isotruss_ros.core.model.description import RobotDescription
from isotruss_ros.core.model.topology import make_topology
from isotruss_ros.core.numerics.arrays import Array, finite_array
from numpy.typing import ArrayLike


class Mechanism:
    """
    Names, topology and constraints of a robot; the subclass `Robot` adds the home configuration.

    :ivar node_names: names of the kinematic nodes: joints j, then t/j/B and t/j/C of each module.
    :ivar member_names: names t/j-k of the members, in module order.
    :ivar module_names: names t/j of the modules, in the order of the robot file.
    :ivar roller_names: names of the driven modules, in the order of every array over the rollers.
    """

    #: (4m,) lengths of `Constraints.spans` at home; only in `Robot` [m]
    home_lengths: Array
    home: Any  #: `Configuration` at zero roller travel; only in `Robot`

    def __init__(self, description: RobotDescription) -> None:
        topology = make_topology(description)
        self.description, self.topology = description, topology
        self.constraints = Constraints(topology)  #: constraints of the configuration
        self.name, self.frame = description.name, description.frame
        self.node_names, self.member_names = topology.node_names, topology.member_names
        self.module_names, self.roller_names = topology.module_names, topology.roller_names

    def check_rollers(self, values: ArrayLike, what: str) -> Array:
        """Return a checked copy of an array (r,) with one number for each roller."""
        names = self.roller_names
        what = f'{what} for {", ".join(names)}'
        return finite_array(values, len(names), what, ConfigurationError)
