"""
The gas in the tubes: an object that indents a sealed tube raises its pressure.

The paper names the lack of this as the failure of its model: stiffness measured against objects
grows with their diameter. Here the object takes from a tube the volume in which it and the
undeformed tube overlap, an upper bound, since a tube that gives is indented less. The gas is
compressed at constant temperature, and the tube's rigidities are those at the raised pressure.
"""

from __future__ import annotations

from isotruss_ros.core.candidates import Candidates
from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.errors import StructureError
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Pressure of the air around [Pa] (ISO 2533).
ATMOSPHERE = 101_325.0
#: An object that takes more of a tube's volume than this does not indent it, it replaces it.
MAX_SHARE = 0.5


def segment_area(depth: Array, radius: float) -> Array:
    """
    Return the area that a straight edge cuts off a circle (c,) [m^2].

    :param depth: (c,) of the cut, 0 to 2 radius [m].
    :param radius: of the circle [m].
    """
    offset = np.clip(1.0 - depth / radius, -1.0, 1.0)
    return radius**2 * (np.arccos(offset) - offset * np.sqrt(1.0 - offset**2))


def raised_pressure(
    config: Configuration, candidates: Candidates, center: complex, radius: float
) -> Array:
    """
    Return the pressure in the tubes with an object between them.

    :param center: of the object [m].
    :param radius: of the disc that centre lines meet, (d + tube diameter) / 2 [m].
    :return: (t,) gauge, by tube in the order of the robot file [Pa].
    :raises StructureError: the object would take half of a tube's volume.
    """
    layout, file = config.robot.layout, config.robot.description
    tube_radius = 0.5 * file.tube_diameter
    depth = np.maximum(0.0, radius - np.abs(candidates.points - center))
    taken = candidates.spacing * segment_area(depth, tube_radius)
    count = len(layout.tube_names)
    indented = np.bincount(layout.tube[candidates.member], taken, minlength=count)
    # Between the pinch points of a module the tube is as long as they are apart.
    length = config.member_lengths + file.module.pinch_separation
    volume = np.pi * tube_radius**2 * np.bincount(layout.tube, length, minlength=count)
    for tube in np.flatnonzero(indented >= MAX_SHARE * volume):
        raise StructureError(
            f'tube {layout.tube_names[tube]}: the object would take {indented[tube]:.4g} m^3 of '
            f'its {volume[tube]:.4g} m^3; it is too large, or in the wrong place'
        )
    absolute = file.pressure + ATMOSPHERE
    return file.pressure + absolute * indented / (volume - indented)
