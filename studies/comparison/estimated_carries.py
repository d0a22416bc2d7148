# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Objects carried in MuJoCo by a robot with roller offsets and slip.

`python -m studies.comparison.estimated_carries` prints the errors of the state estimator in some
minutes; with `--discs 20 --boxes 10 --others 20` in half an hour.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
import sys
from typing import Any

from isotruss_ros.calibration.home import move_home
from isotruss_ros.core import Grip, place_between, Pose, Robot
from isotruss_ros.core.estimation.state_estimate import EstimatedTravel, EstimatorSettings
from isotruss_ros.core.estimation.state_estimator import StateEstimator
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.planning.foresee_path import foresee_path
from isotruss_ros.core.servo.servo_settings import SqueezeSettings
from isotruss_ros.mujoco_plant.options import PlantOptions
import numpy as np
from pressed_plants import hold_at_home, round_robot, soften
from studies.comparison.carrying import RATE, Regulated, squeeze_in
from studies.comparison.random_carries import BOX, DISC, draw_grip, FRICTION, NOISE

#: Three joints that determine all offsets of the nine-member robot in one posture (P, R and Z do
#: not), and all six joints.
THREE, SIX = ('Q', 'R', 'Z'), ('P', 'Q', 'R', 'X', 'Y', 'Z')
#: Noise of the markers [m], their period, which is also that of the poses [s], and the share of
#: lost markers [-].
MARKER, PERIOD, LOST = 1e-3, 0.05, 0.3
#: Slip of the rollers [-], standard deviations of their offsets [m] and of the measured stiffness
#: [-].
SLIP, ZEROS, MEASURED = 0.02, 0.01, 0.03
#: Largest possible inclination of the robot, which lies flat [rad].
INCLINATION = 0.02
#: Rest before and after the path [s], number of legs [-], time of a leg [s], and largest step of a
#: leg [m, rad].
REST, LEGS, LEG_TIME, REACH = 3.0, 2, 4.0, np.array([0.03, 0.03, 0.1])
#: Initial indentation of the members [m].
BEGIN = 0.004
#: Largest squeeze at which no tube wrinkles along the path [N].
MOST = 40.0
#: Kind of object, joints with markers, factor on the stiffness, and whether the loop uses the
#: estimate.
CASES = (
    (DISC, THREE, 1.0, True),
    (BOX, THREE, 1.0, True),
    (DISC, THREE, 0.6, True),
    (DISC, THREE, 1.5, True),
    (DISC, SIX, 1.0, True),
    (DISC, (), 1.0, False),
)


@dataclass(frozen=True)
class Carried:
    """Result of one object's carry."""

    squeeze: float  #: relative error of the true squeeze a second after the path [-]
    worst: float  #: largest relative error of the true squeeze on the path [-]
    surprise: float  #: final error of the estimated squeeze in standard deviations [-]
    encoders: float  #: largest error of a joint by the encoders alone [m]
    joints: float  #: largest error of a joint by the estimate [m]


def carry(
    kind: str,
    seed: int,
    names: Sequence[str] = THREE,
    stiffness: float = 1.0,
    fed: bool = True,
) -> Carried:
    """
    Carry one object along a random path; replace it by another if it is lost at its release.

    :param kind: kind of the object.
    :param seed: seed of the random numbers.
    :param names: joints with markers.
    :param stiffness: ratio of the tubes' true stiffness to that of the robot file.
    :param fed: whether the control loop uses the estimate.
    """
    rng = np.random.default_rng(seed)
    believed = soften(round_robot(), stiffness * (1.0 + MEASURED * rng.normal()))
    zeros = ZEROS * rng.normal(size=len(believed.roller_names))
    true = Robot(move_home(soften(round_robot(), stiffness), zeros))
    while True:
        grip, target, legs = _draw_task(true, kind, rng)
        angle = grip.body.pose.angle
        body = place_between(true.home, grip.members, grip.body.shape, angle, BEGIN).body
        body = replace(body, mass=0.5, friction=FRICTION)
        plant = hold_at_home(true, body, grip.members, PlantOptions(friction=FRICTION))
        if squeeze_in(plant):  # it may leave at so small a depth, before there is a loop
            break
    grip = replace(grip, body=body)
    loop = _Loop(plant, believed, grip, SqueezeSettings(target), (*NOISE, rng))
    loop.names, loop.fed = names, fed
    loop.run(REST)
    loop.moving = True
    for leg in legs:
        loop.run(LEG_TIME, leg / LEG_TIME)
    loop.run(REST)
    return loop.judge()


def _draw_task(robot: Robot, kind: str, rng: np.random.Generator) -> tuple[Grip, float, Array]:
    """Return a grip, its squeeze [N] and path segments (n, 3) on which the model is valid."""
    while True:
        grip, held = draw_grip(robot, kind, rng)
        legs = rng.uniform(-1.0, 1.0, (LEGS, 3)) * REACH
        poses = np.array(held.pose) + np.vstack([np.zeros(3), np.cumsum(legs, axis=0)])
        squeeze = held.squeeze
        if not foresee_path(held, FRICTION, poses).why:
            return grip, min(squeeze, MOST), legs


class _Loop(Regulated):
    """Servo and estimator with their measurements."""

    names: Sequence[str] = THREE
    fed = moving = False

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        robot = self.servo.robot
        self.estimator = StateEstimator(
            robot,
            EstimatorSettings(zero_deviation=ZEROS, stiffness=MEASURED, inclination=INCLINATION),
        )
        self.estimator.set_grip(self.servo.settings.grip.moved_to(self.plant.object_pose()))
        self.joints = robot.topology.joint_names
        self.offsets = np.zeros(len(robot.roller_names))
        self.squeezes: list[float] = []
        self._measured = -1.0

    def step(self, twist: Array) -> None:
        """Simulate one cycle."""
        super().step(twist)
        if self.moving:
            self.squeezes.append(squeeze_in(self.plant))

    def command(self, twist: Array, error: Array) -> Array:
        """Return the velocities of the tubes, which slip at the rollers."""
        return (1.0 - SLIP) * super().command(twist, error)

    def measure(self) -> tuple[RollerState, Pose]:
        """Return the measurements after an update of the estimator."""
        now, readings = self.plant.time, self.plant.travel / (1.0 - SLIP)
        state, pose = super().measure()
        self.estimator.take_encoders(now, readings)
        if now - self._measured >= PERIOD - 1e-6:
            self._measured = now
            self._measure_seldom(now, pose)
        estimate = self.estimator.estimate()
        if self.fed:
            self.offsets = estimate.offsets
            self.servo.receive(
                estimate=StampedInput(
                    EstimatedTravel(estimate.offsets, estimate.offset_covariance),
                    now,
                )
            )
        return RollerState(readings + self.offsets, state.velocities, self.offsets), pose

    def _measure_seldom(self, now: float, pose: Pose) -> None:
        """Pass pose and markers to the estimator when they are due."""
        joints = self.plant.nodes[: len(self.joints)]
        self.estimator.take_pose(now, pose, self.deviations)
        if self.names and self.rng.random() > LOST:
            seen = {
                name: tuple(joints[self.joints.index(name)] + MARKER * self.rng.normal(size=2))
                for name in self.names
            }
            self.estimator.take_markers(now, seen, MARKER)

    def judge(self) -> Carried:
        """Return the errors of all estimates."""
        found, truth, count = self.estimator.estimate(), squeeze_in(self.plant), len(self.joints)
        target = self.servo.settings.squeeze.force
        joints = self.plant.nodes[:count]
        blind = self.servo.robot.home.moved_to(self.plant.travel / (1.0 - SLIP)).nodes[:count]
        moved = np.array(self.squeezes) / target - 1.0
        # Noise and waves of the plant are not what the loop regulates.
        window = np.full(round(0.2 * RATE), 5.0 / RATE)
        return Carried(
            float(np.mean(self.squeezes[-round(RATE) :])) / target - 1.0,
            float(np.abs(np.convolve(moved, window, 'valid')).max()),
            (found.squeeze - truth) / found.squeeze_deviation,
            float(np.hypot(*(blind - joints).T).max()),
            float(np.hypot(*(found.joints - joints).T).max()),
        )


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Print the results of random objects.

    :param arguments: arguments of the command line; None: those of the process.
    :return: 0.
    """
    parser = argparse.ArgumentParser(
        prog='python -m studies.comparison.estimated_carries', description=__doc__
    )
    parser.add_argument('--discs', type=int, default=4, help='of the first case; default: 4')
    parser.add_argument('--boxes', type=int, default=2, help='default: 2')
    parser.add_argument('--others', type=int, default=2, help='of each further case; default: 2')
    options = parser.parse_args(arguments)
    counts = {CASES[0]: options.discs, CASES[1]: options.boxes}
    headings = [
        'objects, joints, tubes',
        'runs',
        'squeeze at the end, median [range] %',
        'worst in motion %',
        'joints off, worst mm',
    ]
    print(f'| {" | ".join(headings)} |')
    print(f'|{" --- |" * len(headings)}')
    for case in CASES:
        count = counts.get(case, options.others)
        if not count:
            continue
        kind, names, stiffness, fed = case
        # Seeds are not chosen.
        found = [carry(kind, seed, names, stiffness, fed) for seed in range(count)]
        off = 100.0 * np.array([one.squeeze for one in found])
        what = f'{kind}, {" ".join(names) if fed else "nothing fed"}, {stiffness:g}'
        print(
            f'| {what} | {count} | {np.median(off):+.1f} [{off.min():+.1f}, {off.max():+.1f}] | '
            f'{100.0 * max(one.worst for one in found):.1f} | '
            f'{1e3 * max(one.joints for one in found):.1f} |',
            flush=True,
        )
    return 0


if __name__ == '__main__':
    sys.exit(main())
