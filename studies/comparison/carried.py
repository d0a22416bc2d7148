# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Carry along Fig. 9 in open loop, with feedback, and with squeeze control."""

from __future__ import annotations

from collections.abc import Sequence

from isotruss_ros.core import Grip, settle_grasp
from isotruss_ros.core.servo.servo_settings import SqueezeSettings
from isotruss_ros.demo.path import figure_9, Phase
from isotruss_ros.mujoco_plant.options import PlantOptions
from matplotlib import rc_context
from matplotlib.figure import Figure
import numpy as np
from pressed_plants import press, PressedCase, release
from studies.comparison.carrying import Carried, carry, Feedback, OpenLoop, Regulated, Steering
from studies.comparison.section import Check, Section
from studies.paper.style import BLUE, GREEN, GREY, ORANGE, PAGE, SETTINGS
from studies.paper.tables import number, Table
from wedge import MODULE

#: Wedge with the opening angle at home, as in the paper's figure, and sufficient friction [-].
CASE, FRICTION = PressedCase(60.0, 0.02), 0.8
OPEN, FEEDBACK, REGULATED = 'open loop', 'feedback', 'squeeze regulated'
COLORS = {OPEN: ORANGE, FEEDBACK: BLUE, REGULATED: GREEN}
#: Line styles, distinct for readers without colour vision.
DASHES = {OPEN: '-', FEEDBACK: '--', REGULATED: '-.'}
#: Bounds of the errors of position [mm] and orientation [degrees].
BOUNDS = {OPEN: (12.0, 1.5), FEEDBACK: (4.0, 0.5), REGULATED: (2.0, 0.3)}
REASONS = {
    OPEN: 'the tubes are elastic, and the program assumes rigid tubes',
    FEEDBACK: 'as above, reduced by feedback with a gain of 1/s',
    REGULATED: 'the robot lags by drag and by the inertia of its masses',
}


def compare(phases: Sequence[Phase] = figure_9()) -> Section:
    """
    Compare three controllers on a carried object.

    :param phases: phases of the path.
    """
    carried = {name: run(name, phases) for name in COLORS}
    checks = []
    for name, result in carried.items():
        position, angle = BOUNDS[name]
        reason = REASONS[name]
        checks.append(
            Check(f'Fig. 9, {name}: position', 1e3 * result.position_error, position, 'mm', reason)
        )
        turned = float(np.degrees(result.angle_error))
        checks.append(Check(f'Fig. 9, {name}: orientation', turned, angle, '°', 'as above'))
    rows = [
        (
            name,
            'lost' if result.lost else 'carried',
            number(1e3 * result.position_error),
            number(float(np.degrees(result.angle_error)), 2),
            number(1e3 * float(np.hypot(*(result.poses - result.goals)[-1, :2])), 2),
            f'{number(float(result.squeezes.min()))} to {number(float(result.squeezes.max()))}',
            number(float(result.frictions.max())),
        )
        for name, result in carried.items()
    ]
    return Section(
        'Fig. 9 carried',
        'An object of 0.3 m in a corner of 60° is carried along the path of Fig. 9 with a '
        f'coefficient of friction of {FRICTION:g}. '
        '“Open loop” is the paper’s program for rigid tubes. “Feedback” adds the pose error times '
        'a gain of 1/s to the twist. “Squeeze regulated” is the servo of `manipulation`.',
        tuple(checks),
        (
            Table(
                'carried',
                'Largest differences on the path',
                (
                    'rollers',
                    'object',
                    'position [mm]',
                    'orientation [°]',
                    'at the end [mm]',
                    'squeeze [N]',
                    'friction used',
                ),
                rows,
                shown=False,
            ),
        ),
        _draw(carried, phases),
        'Left the path of the object with its ends, right the distance from the path over time, '
        'in the three ways: large and back to zero open loop, smaller with feedback, smallest '
        'with the squeeze regulated.',
    )


def run(name: str, phases: Sequence[Phase]) -> Carried:
    """
    Carry the object with one controller.

    :param name: name of the controller.
    :param phases: phases of the path.
    """
    plant, config, cylinder = press(CASE, options=PlantOptions())
    release(plant, FRICTION)
    body = cylinder.moved_to(plant.object_pose())
    grip = Grip.at_module(config.robot, MODULE, body, FRICTION)
    steering: Steering
    if name == OPEN:
        steering = OpenLoop(plant, config, grip)
    elif name == FEEDBACK:
        steering = Feedback(plant, config, grip)
    else:
        settled = settle_grasp(config, body, FRICTION)
        squeeze = float(np.mean(list(settled.normal_forces.values())))
        settings = SqueezeSettings(squeeze)
        steering = Regulated(plant, config.robot, grip, settings)
    return carry(steering, phases)


def _draw(carried: dict[str, Carried], phases: Sequence[Phase]) -> Figure:
    """Draw the paths and the errors over time."""
    with rc_context(SETTINGS):
        figure = Figure(figsize=(PAGE, 2.6), layout='constrained')
        where, when = figure.subplots(1, 2, width_ratios=(1.0, 1.6))
        for name, result in carried.items():
            x, y = result.poses[:, :2].T
            where.plot(x, y, DASHES[name], color=COLORS[name], label=name)
            off = 1e3 * np.hypot(*(result.poses - result.goals)[:, :2].T)
            when.plot(result.times, off, DASHES[name], color=COLORS[name], label=name)
        goal = carried[OPEN].goals
        where.plot(goal[:, 0], goal[:, 1], color=GREY, linestyle=':', label='path', zorder=0)
        where.set(xlabel='x [m]', ylabel='y [m]', aspect='equal')
        when.set(xlabel='time [s]', ylabel='distance from the path [mm]', ylim=(0.0, None))
        end = 0.0
        for phase in phases:
            when.axvline(end, color=GREY, linewidth=0.5)
            when.annotate(
                phase.name, (end + 0.2, 1.0), xycoords=('data', 'axes fraction'), va='bottom'
            )
            end += phase.duration
        when.legend()
    return figure
