# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Content of a robot file as plain values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

#: Mass of a module with its joint if the robot file has none [kg].
DEFAULT_MODULE_MASS = 1.0


@dataclass(frozen=True)
class Module:
    """Dimensions, rigidities and mass of the roller modules, see docs/robot_file.md."""

    pinch_separation: float  #: distance s of the pinch points B and C [m]
    rod_length: float  #: length h of the rod from the joint to the midpoint of BC [m]
    guide_ring_distance: float  #: distance g of the guide rings from the pinch points [m]
    axial_rigidity: float  #: EA of the rigid parts [N]
    flexural_rigidity: float  #: EI of the rigid parts [N m^2]
    mass: float | None = None  #: mass of a module with its joint; None if unknown [kg]


@dataclass(frozen=True)
class Tube:
    """Closed tube through `joints`; the module at the joint `passive` has no motor."""

    name: str  #: name of the tube
    joints: tuple[str, ...]  #: names of the joints in the order in which the tube visits them
    passive: str  #: name of the joint whose module has no motor


@dataclass(frozen=True)
class RobotDescription:
    """Content of a robot file with a valid form; the mechanics are checked later."""

    source: str  #: path of the robot file, for error messages
    name: str  #: name of the robot
    frame: str  #: name of the robot's coordinate frame
    #: position (x, y) of each joint at home, by the joint's name [m]
    joints: Mapping[str, tuple[float, float]]
    tubes: tuple[Tube, ...]  #: the closed tubes
    module: Module  #: dimensions of the roller modules
    tube_diameter: float  #: outer diameter of the tubes [m]
    #: gauge pressure of each tube by the tube's name, in the order of the file [Pa]
    pressures: Mapping[str, float]
    stiffness: Mapping[str, Any]  #: block `stiffness` of the robot file, unchanged
    #: axes (`x`, `y`) along which each supported joint is fixed, by the joint's name
    supports: Mapping[str, tuple[str, ...]]
    max_speed: float  #: largest speed of a roller [m/s]
    max_acceleration: float  #: largest acceleration of a roller [m/s^2]
    min_length: float  #: smallest length of a member, pinch point to pinch point [m]
    max_length: float  #: largest length of a member, pinch point to pinch point [m]
    #: ratio of the true flattening stiffness to the theoretical one [-]
    local_stiffness: float = 1.0
    stiffness_scale: float = 1.0  #: ratio of the tubes' true stiffness to the modelled one [-]
    mass_per_length: float = 0.1  #: mass of the tubes per length [kg/m]
    #: block `calibration` of the file, with the standard deviations of roller offsets and
    #: stiffness
    calibration: Mapping[str, Any] = field(default_factory=dict)
    #: block `uncertainty` of the file: standard deviations of parameters
    uncertainty: Mapping[str, Any] = field(default_factory=dict)

    @property
    def braking_rate(self) -> float:
        """Return the ratio of the rollers' largest acceleration to their largest speed [1/s]."""
        return self.max_acceleration / self.max_speed
