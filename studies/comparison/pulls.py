# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Slip margins under pulls in eight directions, predicted and simulated."""

from __future__ import annotations

from collections.abc import Sequence
import math

from isotruss_ros.core import HoldStatus
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np
from pressed_plants import press, PressedCase, release
from studies.comparison.grasps import STEPS
from studies.comparison.section import Check, Section
from studies.paper.tables import number, Table

GRIPS, FRICTION = (PressedCase(40.0, 0.04), PressedCase(30.0, 0.08)), 0.5
DIRECTIONS = tuple(math.radians(45.0 * k) for k in range(8))
#: Rate of the pull [N/s], and period of the check [s].
RATE, PERIOD = 0.5, 0.02
#: Share of the prediction up to which the pull rises faster [-], and ratio of the rates [-].
SURE, QUICKER = 0.7, 8.0
#: Used share of friction at which a contact slips [-].
SLIPS = 0.999
#: First and last step of the search for the pull [N].
STEP, FINEST = 0.5, 1e-3
#: Largest pull [N].
LARGEST = 50.0


def compare(
    grips: Sequence[PressedCase] = GRIPS, directions: Sequence[float] = DIRECTIONS
) -> Section:
    """
    Compare the pulls at which a contact slips or opens.

    :param grips: wedges and objects.
    :param directions: directions of the pulls, from x counter-clockwise [rad].
    """
    rows, errors = [], []
    for grip in grips:
        plant, config, cylinder = press(grip)
        release(plant, FRICTION)
        state = plant.save()
        model = attach_grip(config, cylinder.moved_to(plant.object_pose()))
        margin = model.slip_margin(FRICTION)
        for direction in directions:
            along = np.array([math.cos(direction), math.sin(direction), 0.0])
            ours = predicted(model, along)
            plant.restore(state)
            theirs = found(plant, along, SURE * ours)
            errors.append(abs(theirs / ours - 1.0))
            name = f'{grip.degrees:.0f}°, {1e3 * grip.shift:.0f} mm'
            cells = (number(theirs), number(ours), number(margin))
            rows.append((name, f'{math.degrees(direction):.0f}', *cells))
    check = Check(
        'force at which a contact slips',
        100.0 * max(errors),
        4.0,
        '%',
        STEPS,
    )
    return Section(
        'Slip margin under pulls',
        f'A force on the held object grows by {RATE:g} N/s in one of eight directions until a '
        f'contact slips in MuJoCo, with friction ({FRICTION:g}). Our value is the force at which '
        'a contact first slips in the equilibrium. The last column is `slip_margin`, the smallest '
        'of all directions, moments included.',
        (check,),
        (
            Table(
                'pulls',
                'Force at which a contact slips or opens [N]',
                ('wedge, shift', 'direction [°]', 'MuJoCo', 'ours', 'slip margin'),
                rows,
                shown=False,
            ),
        ),
    )


def predicted(model: HeldGrip, along: Array) -> float:
    """
    Return the pull at which the equilibrium slips, opens or vanishes [N].

    :param model: equilibrium of the object.
    :param along: (3,) wrench of a unit pull.
    """
    size, step = 0.0, STEP
    while step > FINEST and size < LARGEST:
        there = roll_grip(model, model.config, (size + step) * along)
        if there is not None and there.hold(FRICTION) is HoldStatus.HELD:
            size, model = size + step, there
        else:
            step *= 0.5
    return size


def found(plant: MujocoPlant, along: Array, sure: float) -> float:
    """
    Return the pull at which a contact slips or opens in MuJoCo [N].

    :param plant: plant that holds the object.
    :param along: (3,) wrench of a unit pull.
    :param sure: pull up to which the pull rises faster [N].
    """
    size = 0.0
    while size < LARGEST:
        size += RATE * PERIOD * (QUICKER if size < sure else 1.0)
        plant.pull(size * along)
        plant.settle(PERIOD)
        forces = plant.contact_forces().values()
        if len(forces) < 2 or max(abs(f.friction) / max(f.normal, 1e-9) for f in forces) >= (
            SLIPS * FRICTION
        ):
            break
    return size
