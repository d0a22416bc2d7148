# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Coefficient of friction at which boxes, hexagons, and objects in three members are lost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from isotruss_ros.core import ConvexObject, place_between, Polygon, settle_grasp
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np
from studies.comparison.box_picked import FRICTION, SIDES
from studies.comparison.friction import distance, lost_at, MOVED, RATE
from studies.comparison.friction import PERIOD as DISC_PERIOD
from studies.comparison.grips import press_on, release, round_robot
from studies.comparison.section import Check, Section
from studies.paper.tables import number, Table

CORNER = ('north/P-Z', 'north/Z-R')
LOOP = ('south/P-Q', 'south/Q-X', 'south/X-P')
PLACES = {SIDES: 'two sides', CORNER: 'corner', LOOP: 'three members'}
#: Radius of the corners of the objects [m].
ROUNDING = 0.02
#: Friction below which it falls slowly, relative to the prediction [-].
NEAR = 1.05
#: Period of the steps of the friction [s]; steps five times as large shake a box on a face loose.
PERIOD = 0.02
#: Range of the sudden decreases relative to the prediction, and their resolution [-].
RANGE, STEP = (0.95, 1.15), 0.02
#: Simulated time after a sudden decrease [s], and displacement of a lost object [m]; faces slide
#: by some millimetres while their forces are redistributed.
WAIT, LOST = 3.0, 0.01


@dataclass(frozen=True)
class Case:
    """A polygon between members."""

    name: str  #: name of the object
    shape: Polygon  #: shape of the object
    members: tuple[str, ...]  #: members that hold the object
    degrees: float  #: orientation of the object [degrees]
    indentation: float = 0.01  #: indentation of each member, for straight tubes [m]


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


CASES = (
    Case('box 500 × 400 mm', box(0.5, 0.4), SIDES, 0.0, 0.008),
    Case('box 500 × 400 mm', box(0.5, 0.4), SIDES, 0.0, 0.012),
    Case('box 500 × 400 mm', box(0.5, 0.4), SIDES, -90.0, 0.008),
    Case('box 400 × 400 mm', box(0.4, 0.4), SIDES, 0.0, 0.008),
    Case('box 600 × 400 mm', box(0.6, 0.4), SIDES, 0.0, 0.008),
    Case('box 450 × 350 mm', box(0.45, 0.35), SIDES, -90.0, 0.008),
    Case('box 500 × 400 mm', box(0.5, 0.4), CORNER, 60.0),
    Case('box 500 × 300 mm', box(0.5, 0.3), CORNER, -60.0),
    Case('box 300 × 200 mm', box(0.3, 0.2), CORNER, 60.0),
    Case('box 200 × 200 mm', box(0.2, 0.2), CORNER, 30.0),
    Case('box 250 × 150 mm', box(0.25, 0.15), CORNER, 60.0),
    Case('box 300 × 300 mm', box(0.3, 0.3), CORNER, -30.0),
    Case('hexagon 500 mm', hexagon(0.25), SIDES, 0.0),
    Case('hexagon 600 mm', hexagon(0.3), SIDES, 0.0),
    Case('hexagon 300 mm', hexagon(0.15), CORNER, 0.0),
    Case('hexagon 400 mm', hexagon(0.2), CORNER, 0.0),
    Case('hexagon 680 mm', hexagon(0.34), LOOP, -15.0),
    Case('hexagon 680 mm', hexagon(0.34), LOOP, 10.0),
    Case('hexagon 660 mm', hexagon(0.33), LOOP, -20.0),
    Case('box 500 × 500 mm', box(0.5, 0.5), LOOP, 10.0),
)


@dataclass(frozen=True)
class Loss:
    """Friction used by an object, and friction at which it is lost."""

    used: float  #: largest ratio of friction to normal force in MuJoCo at `FRICTION` [-]
    slowly: float  #: friction at which the object is lost in MuJoCo as it falls slowly [-]
    suddenly: float  #: largest friction to which a sudden decrease loses the object [-]
    ours: float  #: required friction of the model [-]


def compare(cases: Sequence[Case] = CASES) -> Section:
    """
    Compare the friction at which polygons are lost.

    :param cases: polygons between members.
    """
    losses = [lose(case) for case in cases]
    rows = [
        (
            case.name,
            PLACES[case.members],
            f'{case.degrees:.0f}',
            f'{1e3 * case.indentation:.0f}',
            *(number(value) for value in (loss.used, loss.slowly, loss.suddenly, loss.ours)),
        )
        for case, loss in zip(cases, losses, strict=True)
    ]
    slow = max(abs(loss.slowly / loss.ours - 1.0) for loss in losses)
    sudden = max(loss.suddenly / loss.ours - 1.0 for loss in losses)
    checks = (
        Check(
            'polygons, friction lowered slowly until lost',
            100.0 * slow,
            10.0,
            '%',
            'not examined',
        ),
        Check(
            'polygons, friction lowered suddenly: lost above our value',
            100.0 * sudden,
            10.0,
            '%',
            'not examined; presumably the forces of a face need time to redistribute',
        ),
    )
    return Section(
        'Boxes and hexagons lost',
        'Polygons, most with a face in contact, are held with a coefficient of friction of '
        f'{FRICTION:g}, and use the given part of it in MuJoCo: the largest ratio of friction to '
        'normal force. Then the coefficient falls, by '
        f'{RATE:g} per second near our value, until the object has moved by '
        f'{1e3 * LOST:g} mm. '
        'From the first state it also falls in one step, to the largest value that moves the '
        f'object as far within {WAIT:g} s (to {STEP:g} of our value). Our value is '
        'the required friction of `settle_grasp`. A face can use almost the whole coefficient and '
        'is not lost until the coefficient falls to our value, if it falls slowly; if it falls '
        'suddenly, the object is lost earlier. The values depend on what counts as a loss, and on '
        f'the steps: the discs above are lost at {1e3 * MOVED:g} mm, while polygons slide by some '
        f'millimetres and stop again; steps {DISC_PERIOD / PERIOD:g} times as large, as for the '
        'discs, shake a box on a face loose.',
        checks,
        (
            Table(
                'faces',
                'Coefficients of friction',
                (
                    'object',
                    'held by',
                    'angle [°]',
                    'indentation [mm]',
                    f'used at {FRICTION:g}',
                    'lost at, slowly',
                    'lost at, suddenly',
                    'ours',
                ),
                rows,
            ),
        ),
    )


def lose(case: Case) -> Loss:
    """
    Lower the friction of one object until it is lost, slowly and suddenly.

    :param case: polygon between members.
    """
    home = round_robot().home
    grip = place_between(
        home, case.members, case.shape, np.radians(case.degrees), case.indentation
    )
    plant = press_on(home, grip.body, case.members)
    release(plant, FRICTION)
    body = grip.body.moved_to(plant.object_pose())
    ours = settle_grasp(home, body, FRICTION, members=case.members).required_friction
    used = max(abs(force.friction) / force.normal for force in plant.contact_forces().values())
    state = plant.save()
    slowly = lost_at(plant, body, FRICTION, NEAR * ours, LOST, PERIOD)
    plant.restore(state)
    return Loss(used, slowly, _suddenly_lost_at(plant, body, ours), ours)


def _suddenly_lost_at(plant: MujocoPlant, body: ConvexObject, ours: float) -> float:
    """Return the largest friction to which a sudden decrease loses the object, by bisection."""
    state = plant.save()
    low, high = (share * ours for share in RANGE)
    while high - low > STEP * ours:
        middle = 0.5 * (low + high)
        plant.restore(state)
        plant.set_friction(middle)
        plant.settle(WAIT)
        if distance(plant, body) > LOST:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
