# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Coefficient of friction at which an object is lost, predicted and simulated."""

from __future__ import annotations

from collections.abc import Sequence

from isotruss_ros.core import ConvexObject, settle_grasp
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np
from studies.comparison.grips import press, PressedCase, release
from studies.comparison.section import Check, Section
from studies.paper.tables import number, Table

GRIPS = (
    PressedCase(60.0, 0.03),
    PressedCase(50.0, 0.03),
    PressedCase(40.0, 0.04),
    PressedCase(30.0, 0.06),
)
#: Initial friction [-], and its rate of decrease [1/s].
FRICTION, RATE = 0.8, 0.005
#: Ratio of a rate far above the friction at which the object is lost [-].
HASTE = 4.0
#: Start of the decrease relative to the prediction [-], and period of the check [s].
START, PERIOD = 1.05, 0.1
#: Displacement at which an object counts as lost [m].
MOVED = 2e-3


def compare(grips: Sequence[PressedCase] = GRIPS) -> Section:
    """
    Compare the friction at which objects are lost.

    :param grips: wedges and objects.
    """
    rows, errors = [], []
    for grip in grips:
        plant, config, cylinder = press(grip)
        release(plant, FRICTION)
        settled = settle_grasp(config, cylinder.moved_to(plant.object_pose()), FRICTION)
        ours = settled.required_friction
        theirs = lost_at(plant, cylinder, START * ours)
        errors.append(abs(theirs / ours - 1.0))
        rows.append(
            (
                f'{grip.degrees:.0f}',
                f'{1e3 * grip.shift:.0f}',
                number(theirs),
                number(ours),
                number(100.0 * (theirs / ours - 1.0), 2),
            )
        )
    check = Check(
        'friction at which an object is lost',
        100.0 * max(errors),
        3.0,
        '%',
        'errors of the normal forces, and the time in which the object moves by 2 mm',
    )
    return Section(
        'Friction lowered until the object is lost',
        f'The coefficient of friction falls by {RATE:g} per second until the object has moved by '
        f'{1e3 * MOVED:g} mm. Our value is the required friction of `settle_grasp`.',
        (check,),
        (
            Table(
                'friction',
                'Coefficient of friction at which the object is lost',
                ('wedge [°]', 'shift [mm]', 'MuJoCo', 'ours', 'off by [%]'),
                rows,
                shown=False,
            ),
        ),
    )


def lost_at(
    plant: MujocoPlant,
    body: ConvexObject,
    start: float,
    near: float = np.inf,
    moved: float = MOVED,
    period: float = PERIOD,
) -> float:
    """
    Return the friction at which the object is lost; zero if it is not lost.

    :param plant: plant that holds the object.
    :param body: the object, with any pose.
    :param start: initial friction [-].
    :param near: friction above which the friction falls `HASTE` times as fast [-].
    :param moved: displacement at which the object counts as lost [m].
    :param period: period of the steps of the friction, and of the check [s].
    """
    plant.set_friction(start)
    plant.settle(1.0)
    before, friction = body.moved_to(plant.object_pose()), start
    while friction > 0.0:
        friction -= RATE * period * (HASTE if friction > near else 1.0)
        plant.set_friction(max(friction, 0.0))
        plant.settle(period)
        if distance(plant, before) > moved:
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
