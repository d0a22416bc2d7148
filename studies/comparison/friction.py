# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Coefficients of friction at which objects slide and are lost, predicted and simulated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from isotruss_ros.core import ConvexObject, settle_grasp
from isotruss_ros.core.holding.friction_range import FrictionRange
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np
from pressed_plants import press_on, release
from studies.comparison.friction_cases import CASES, DiscCase, PolygonCase
from studies.comparison.section import Check, Section
from studies.paper.tables import number, Table

#: Initial friction [-], its rate of decrease near the prediction [1/s], and period of its steps
#: [s]; steps five times as large shake a box on a face loose.
FRICTION, RATE, PERIOD = 0.9, 0.005, 0.02
#: Multiple of the rate above `NEAR` times the prediction, and this ratio [-].
HASTE, NEAR = 4.0, 1.05
#: Displacement within `WINDOW` [s] at which an object slides [m]: while the forces of a face are
#: redistributed it moves at less than 0.2 mm/s; a disc that slides out of a corner requires less
#: and less friction, so that it follows the coefficient at 0.7 mm/s before it is lost.
SLIDE, WINDOW = 1e-4, 0.2
#: Range of the sudden decreases relative to the prediction, and their resolution [-].
RANGE, STEP = (0.95, 1.15), 0.02
#: Simulated time after a sudden decrease [s], and displacement of a lost object [m]; faces slide
#: by some millimetres while their forces are redistributed.
WAIT, LOST = 3.0, 0.01
#: Bounds of the distances outside of the friction range, after a slow and a sudden decrease, which
#: is resolved to `STEP` and loses an object near the boundary too late for `WAIT` [-].
SLOW_BOUND, SUDDEN_BOUND = 0.03, 0.04


@dataclass(frozen=True)
class Loss:
    """Friction used by an object, and friction at which it slides or is lost."""

    used: float  #: largest ratio of friction to normal force in MuJoCo at `FRICTION` [-]
    slowly: float  #: friction at which the object slides in MuJoCo as friction falls slowly [-]
    suddenly: float  #: largest friction to which a sudden decrease loses the object [-]
    ours: FrictionRange  #: friction range of the model

    def outside(self, friction: float) -> float:
        """Return the relative distance of a coefficient of friction outside of the range [-]."""
        necessary, sufficient = self.ours
        return max(1.0 - friction / necessary, friction / sufficient - 1.0, 0.0)


def compare(cases: Sequence[DiscCase | PolygonCase] = CASES) -> Section:
    """
    Compare the friction at which objects slide and are lost.

    :param cases: objects between members.
    """
    return tabulate(cases, [lose(case) for case in cases])


def tabulate(cases: Sequence[DiscCase | PolygonCase], losses: Sequence[Loss]) -> Section:
    """
    Return the section of simulated cases.

    :param cases: objects between members.
    :param losses: results of the cases.
    """
    rows = [
        (
            *case.cells,
            *(number(value) for value in (loss.used, loss.slowly, loss.suddenly, *loss.ours)),
        )
        for case, loss in zip(cases, losses, strict=True)
    ]
    checks = (
        Check(
            'friction lowered slowly: outside of the friction range, an object slides',
            100.0 * max(loss.outside(loss.slowly) for loss in losses),
            100.0 * SLOW_BOUND,
            '%',
            'errors of the normal forces, and the segments of the tubes',
        ),
        Check(
            'friction lowered suddenly: outside of the friction range, an object is lost',
            100.0 * max(loss.outside(loss.suddenly) for loss in losses),
            100.0 * SUDDEN_BOUND,
            '%',
            f'resolved to {100.0 * STEP:g} %; just below the range an object slides by less than '
            f'{1e3 * LOST:g} mm in {WAIT:g} s',
        ),
    )
    return Section(
        'Friction lowered until the object is lost',
        f'Discs, boxes, hexagons and objects between three members, at rest with a coefficient of '
        f'friction of {FRICTION:g}, use the given part of it in MuJoCo: the largest ratio of '
        'friction to normal force. Then the coefficient falls, '
        f'by {RATE:g} per second near our value, until the object slides, at '
        f'{1e3 * SLIDE / WINDOW:g} mm/s. From the first state it also falls in one step, to the '
        f'largest value that moves the object by {1e3 * LOST:g} mm within {WAIT:g} s '
        f'(to {STEP:g} of our value). In MuJoCo the object has 0.5 kg, a module 1 kg, without '
        'noise. Our values '
        'are the [friction range](closure.md#contact-history-and-friction-range) of '
        '`settle_grasp`. A face can use almost the whole coefficient, and yet slides near the '
        'necessary one if friction falls slowly. After a slide a polygon may stop with a smaller '
        'squeeze.',
        checks,
        (
            Table(
                'friction',
                'Coefficients of friction',
                (
                    'object',
                    'held by',
                    'wedge or angle [°]',
                    'shift or indentation [mm]',
                    f'used at {FRICTION:g}',
                    'slides at, slowly',
                    'lost at, suddenly',
                    'necessary',
                    'sufficient',
                ),
                rows,
            ),
        ),
    )


def lose(case: DiscCase | PolygonCase) -> Loss:
    """
    Lower the friction of one object until it slides, slowly and suddenly.

    :param case: object between members.
    """
    config, body, members = case.pressed()
    plant = press_on(config, body, members)
    release(plant, FRICTION)
    body = body.moved_to(plant.object_pose())
    ours = settle_grasp(config, body, FRICTION, members=members).friction_range
    used = max(abs(force.friction) / force.normal for force in plant.contact_forces().values())
    state = plant.save()
    slowly = slides_at(plant, body, NEAR * ours.necessary)
    plant.restore(state)
    return Loss(used, slowly, _suddenly_lost_at(plant, body, ours.necessary), ours)


def slides_at(plant: MujocoPlant, body: ConvexObject, near: float) -> float:
    """
    Return the friction at which the object slides; zero if it does not.

    :param plant: plant that holds the object.
    :param body: the object, with any pose.
    :param near: friction above which the friction falls `HASTE` times as fast [-].
    """
    friction = FRICTION
    while friction > 0.0:
        before = body.moved_to(plant.object_pose())
        for _ in range(round(WINDOW / PERIOD)):
            friction -= RATE * PERIOD * (HASTE if friction > near else 1.0)
            plant.set_friction(max(friction, 0.0))
            plant.settle(PERIOD)
            if distance(plant, before) > SLIDE:
                return friction
    return 0.0


def distance(plant: MujocoPlant, before: ConvexObject) -> float:
    """
    Return the distance of the object from a pose, with the rotation times its radius [m].

    :param plant: plant with the object.
    :param before: the object at the pose.
    """
    x, y, angle = np.subtract(plant.object_pose(), before.pose)
    return float(np.hypot(x, y) + before.arm * abs(angle))


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
