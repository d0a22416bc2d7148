"""A tube with clamped ends and a cylinder pressed into its side: the test of Fig. 6."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.beam import local_stiffness
from isotruss_ros.core.candidates import Candidates
from isotruss_ros.core.contact import solve_contact
from isotruss_ros.core.gas import ATMOSPHERE, segment_area
from isotruss_ros.core.interior import InteriorPoints
from isotruss_ros.core.tube_stiffness import TubeStiffness
from isotruss_ros.paper.parameters import PRESSURE, TUBE_DIAMETER, TUBE_LENGTH
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Of the points that the cylinder could touch [m].
SPACING = 0.001
#: How deep the cylinders are pressed, where nothing else is said [m].
DEPTH = 0.010


@dataclass(frozen=True)
class Pressed:
    """
    What it takes to press the cylinder in.

    :ivar stiffness: force across the tube over the depth [N/m].
    :ivar pressure: in the tube, gauge [Pa].
    :ivar contact: length of tube in contact [m].
    """

    stiffness: float
    pressure: float
    contact: float


def press(
    tube: TubeStiffness,
    position: float,
    disc: float,
    depth: float,
    gas: bool = False,
    pinned: bool = False,
) -> Pressed:
    """
    Press a disc into the centre line of the tube, from above: (5) to (8), gas as in `core.gas`.

    :param tube: its stiffness.
    :param position: of the disc's centre along the tube [m].
    :param disc: diameter of cylinder and tube together [m].
    :param depth: of the disc below the undeformed centre line [m].
    :param gas: whether the cylinder compresses the gas in this length of tube.
    :param pinned: whether the ends turn freely, instead of being clamped.
    """
    center, radius = complex(position, 0.5 * disc - depth), 0.5 * disc
    reach = np.arange(-int(radius / SPACING) - 2, int(radius / SPACING) + 3)
    places = position + SPACING * reach
    places = places[(places > 0.0) & (places < TUBE_LENGTH)]
    pressure = PRESSURE
    if gas:
        dent = np.maximum(0.0, radius - np.abs(places - center))
        taken = SPACING * float(segment_area(dent, 0.5 * TUBE_DIAMETER).sum())
        volume = 0.25 * np.pi * TUBE_DIAMETER**2 * TUBE_LENGTH
        pressure += (PRESSURE + ATMOSPHERE) * taken / (volume - taken)
    contact = solve_contact(_candidates(tube, pressure, places, pinned), center, radius)
    force = -float((contact.forces * contact.normals).imag.sum())
    return Pressed(force / depth, pressure, SPACING * int((contact.forces > 0.0).sum()))


def _candidates(tube: TubeStiffness, pressure: float, places: Array, pinned: bool) -> Candidates:
    """Return points inside one member whose ends turn, if they are pinned, or stand still."""
    only, length = np.zeros(len(places), dtype=np.intp), np.array([TUBE_LENGTH])
    rigidities = tube.rigidities(length, pressure)
    inside = InteriorPoints(only, places, length, *rigidities, np.array([[False, False]]))
    ends = np.zeros((6, 6))
    if pinned:
        turns = np.ix_([2, 5], [2, 5])
        ends[turns] = np.linalg.inv(local_stiffness(length, *rigidities)[0][turns])
    return Candidates(
        points=places.astype(np.complex128),
        member=only,
        spacing=SPACING,
        axis=np.ones(len(places), dtype=np.complex128),
        inside=inside.compliance(),
        spread=inside.shapes(),
        ends=ends,
    )
