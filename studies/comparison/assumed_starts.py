# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
True squeeze of objects in MuJoCo at starts of the loop with an assumed equilibrium.

`python -m studies.comparison.assumed_starts` starts the loop with roller offsets of 10 mm on
objects that are already held, and prints the spread of the true squeeze, in some minutes.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
import sys

from isotruss_ros.calibration.home import move_home
from isotruss_ros.core import place_between, Robot
from isotruss_ros.core.servo.servo_settings import SqueezeSettings
from isotruss_ros.mujoco_plant.options import PlantOptions
import numpy as np
from pressed_plants import hold_at_home, round_robot
from studies.comparison.carrying import RATE, squeeze_in
from studies.comparison.faulty_carries import Draw, Loop, ZEROS
from studies.comparison.random_carries import BOX, DISC, draw_grip, FRICTION

#: Initial indentations of the members [m]. The desired squeeze is that of the model at 10 mm.
INDENTATIONS = (0.004, 0.01)
#: Largest time until the loop has an equilibrium, and time after it [s].
WAIT, REST = 1.0, 1.0


def start(shape: str, seed: int, indentation: float) -> tuple[bool, float] | None:
    """
    Start the loop on a held object without a motion.

    :param shape: shape of the object, `DISC` or `BOX`.
    :param seed: seed of offsets, object and noise.
    :param indentation: initial indentation of the members [m].
    :return: whether the loop assumed the equilibrium, and the ratio of the true squeeze to the
        desired one after the rest [-]; None if no equilibrium is found or the object is lost.
    """
    rng = np.random.default_rng([seed, (DISC, BOX).index(shape)])
    robot = round_robot()
    zeros = ZEROS * rng.normal(size=len(robot.roller_names))
    true = Robot(move_home(robot, zeros))
    grip, held = draw_grip(robot, shape, rng)
    angle = grip.body.pose.angle
    body = place_between(true.home, grip.members, grip.body.shape, angle, indentation).body
    body = replace(body, mass=0.5, friction=FRICTION)
    plant = hold_at_home(true, body, grip.members, PlantOptions(friction=FRICTION))
    settings = SqueezeSettings(held.squeeze)
    loop = Loop(plant, robot, replace(grip, body=body), settings, Draw((), zeros), rng)
    for _ in range(round(WAIT * RATE)):
        loop.step(np.zeros(3))
        if loop.control.tracker.belief is not None:
            break
    else:
        return None
    is_assumed = loop.control.tracker.belief.is_assumed
    loop.run(REST)
    squeeze = squeeze_in(plant)
    return (is_assumed, squeeze / held.squeeze) if squeeze else None


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Print the spread of the true squeeze.

    :param arguments: arguments of the command line; None: those of the process.
    :return: 0.
    """
    parser = argparse.ArgumentParser(
        prog='python -m studies.comparison.assumed_starts', description=__doc__
    )
    parser.add_argument('--objects', type=int, default=44, help='of each indentation; default 44')
    options = parser.parse_args(arguments)
    print('| closed by | starts | assumed | true minus desired squeeze, median [range] % |')
    print('| --- | --- | --- | --- |')
    for indentation in INDENTATIONS:
        found = [start((DISC, BOX)[k % 2], k // 2, indentation) for k in range(options.objects)]
        starts = [one for one in found if one is not None]
        off = [100.0 * (ratio - 1.0) for is_assumed, ratio in starts if is_assumed]
        spread = '–'
        if off:
            spread = f'{np.median(off):+.0f} [{min(off):+.0f}, {max(off):+.0f}]'
        closed = f'{1e3 * indentation:.0f} mm'
        print(f'| {closed} | {len(starts)} | {len(off)} | {spread} |', flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
