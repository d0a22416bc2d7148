"""What a robot file describes, as plain values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Module:
    """Dimensions [m] and rigidities of the roller modules (see docs/robot_file.md)."""

    pinch_separation: float
    rod_length: float
    guide_ring_distance: float
    axial_rigidity: float
    flexural_rigidity: float


@dataclass(frozen=True)
class Tube:
    """The closed tube through `joints`; the module at joint `passive` has no motor."""

    name: str
    joints: tuple[str, ...]
    passive: str


@dataclass(frozen=True)
class RobotDescription:
    """
    What a robot file says, checked for form but not yet for mechanics.

    Lengths in m, pressure in Pa, speeds in m/s; `stiffness` is the block of the file as it stands.
    """

    source: str
    name: str
    frame: str
    joints: Mapping[str, tuple[float, float]]
    tubes: tuple[Tube, ...]
    module: Module
    tube_diameter: float
    pressure: float
    stiffness: Mapping[str, Any]
    supports: Mapping[str, tuple[str, ...]]
    max_speed: float
    min_length: float
    max_length: float
