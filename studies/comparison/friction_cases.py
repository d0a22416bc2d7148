# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Objects that are lost when friction falls: discs, and polygons at two or three members."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core import Configuration, ConvexObject, place_between, Polygon
from isotruss_ros.core.manipulation.grip import members_at
import numpy as np
from pressed_plants import place, PressedCase, round_robot
from studies.comparison.box_picked import SIDES
from wedge import MODULE

CORNER = ('north/P-Z', 'north/Z-R')
LOOP = ('south/P-Q', 'south/Q-X', 'south/X-P')
PLACES = {SIDES: 'two sides', CORNER: 'corner', LOOP: 'three members'}
#: Radius of the corners of the polygons [m].
ROUNDING = 0.02


@dataclass(frozen=True)
class PolygonCase:
    """A polygon between members of the robot at home."""

    name: str  #: name of the object
    shape: Polygon  #: shape of the object
    members: tuple[str, ...]  #: members that hold the object
    degrees: float  #: orientation of the object [degrees]
    indentation: float = 0.01  #: indentation of each member, for straight tubes [m]

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """Return object, place, orientation and indentation in words."""
        return (
            self.name,
            PLACES[self.members],
            f'{self.degrees:.0f}',
            f'{1e3 * self.indentation:.0f}',
        )

    def pressed(self) -> tuple[Configuration, ConvexObject, tuple[str, ...]]:
        """Return the configuration of the robot, the object, and the members that press it."""
        home = round_robot().home
        angle = float(np.radians(self.degrees))
        grip = place_between(home, self.members, self.shape, angle, self.indentation)
        return home, grip.body, self.members


@dataclass(frozen=True)
class DiscCase:
    """A disc in a corner."""

    wedge: PressedCase  #: corner and disc

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """Return object, place, opening angle and shift into the corner in words."""
        wedge = self.wedge
        return (
            f'disc {1e3 * wedge.diameter:.0f} mm',
            'corner',
            f'{wedge.degrees:.0f}',
            f'{1e3 * wedge.shift:.0f}',
        )

    def pressed(self) -> tuple[Configuration, ConvexObject, tuple[str, ...]]:
        """Return the configuration of the robot, the object, and the members that press it."""
        config, disc = place(self.wedge)
        return config, disc, tuple(members_at(config.robot, MODULE))


def box(width: float, height: float) -> Polygon:
    """
    Return a box.

    :param width: width [m].
    :param height: height [m].
    """
    x, y = 0.5 * width, 0.5 * height
    return Polygon([(-x, -y), (x, -y), (x, y), (-x, y)], ROUNDING)


def hexagon(radius: float) -> Polygon:
    """
    Return a regular hexagon.

    :param radius: distance of its corners from its centre, before rounding [m].
    """
    corners = radius * np.exp(1j * np.pi / 3.0 * np.arange(6))
    return Polygon([(z.real, z.imag) for z in corners], ROUNDING)


#: Opening angles [degrees], shifts into the corner [m] and diameters [m] of discs, all of which
#: the model holds without wrinkling.
WEDGES = (
    *((60.0, 0.03, 0.3), (50.0, 0.03, 0.3), (40.0, 0.04, 0.3), (30.0, 0.06, 0.3)),
    *((60.0, 0.02, 0.3), (55.0, 0.03, 0.25), (45.0, 0.05, 0.25), (35.0, 0.05, 0.25)),
    *((60.0, 0.02, 0.2), (50.0, 0.03, 0.2), (40.0, 0.05, 0.2), (30.0, 0.06, 0.2)),
)
CASES: tuple[DiscCase | PolygonCase, ...] = (
    *(DiscCase(PressedCase(*wedge)) for wedge in WEDGES),
    PolygonCase('box 500 × 400 mm', box(0.5, 0.4), SIDES, 0.0, 0.008),
    PolygonCase('box 500 × 400 mm', box(0.5, 0.4), SIDES, 0.0, 0.012),
    PolygonCase('box 500 × 400 mm', box(0.5, 0.4), SIDES, -90.0, 0.008),
    PolygonCase('box 400 × 400 mm', box(0.4, 0.4), SIDES, 0.0, 0.008),
    PolygonCase('box 600 × 400 mm', box(0.6, 0.4), SIDES, 0.0, 0.008),
    PolygonCase('box 450 × 350 mm', box(0.45, 0.35), SIDES, -90.0, 0.008),
    PolygonCase('box 500 × 400 mm', box(0.5, 0.4), CORNER, 60.0),
    PolygonCase('box 500 × 300 mm', box(0.5, 0.3), CORNER, -60.0),
    PolygonCase('box 300 × 200 mm', box(0.3, 0.2), CORNER, 60.0),
    PolygonCase('box 200 × 200 mm', box(0.2, 0.2), CORNER, 30.0),
    PolygonCase('box 250 × 150 mm', box(0.25, 0.15), CORNER, 60.0),
    PolygonCase('box 300 × 300 mm', box(0.3, 0.3), CORNER, -30.0),
    PolygonCase('hexagon 500 mm', hexagon(0.25), SIDES, 0.0),
    PolygonCase('hexagon 600 mm', hexagon(0.3), SIDES, 0.0),
    PolygonCase('hexagon 560 mm', hexagon(0.28), SIDES, 30.0),
    PolygonCase('hexagon 300 mm', hexagon(0.15), CORNER, 0.0),
    PolygonCase('hexagon 400 mm', hexagon(0.2), CORNER, 0.0),
    PolygonCase('hexagon 350 mm', hexagon(0.175), CORNER, 30.0),
    PolygonCase('hexagon 680 mm', hexagon(0.34), LOOP, -15.0),
    PolygonCase('hexagon 680 mm', hexagon(0.34), LOOP, 10.0),
    PolygonCase('hexagon 660 mm', hexagon(0.33), LOOP, -20.0),
    PolygonCase('hexagon 670 mm', hexagon(0.335), LOOP, 12.0),
    PolygonCase('box 500 × 500 mm', box(0.5, 0.5), LOOP, 10.0),
    PolygonCase('box 500 × 500 mm', box(0.5, 0.5), LOOP, 20.0),
)
