# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Prediction of a run by the model: the object rolls on the tubes as the rollers move."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
import itertools
from typing import NamedTuple

from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.friction_range import find_friction_range, FrictionRange
from isotruss_ros.core.holding.held_grip import HeldGrip, NotHeldError
from isotruss_ros.core.holding.roll_grip import roll_grip, with_tubes
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.statics.tube_stiffness import tube_pressures
from isotruss_ros.identification.measured_run import MeasuredRun, RunError
import numpy as np

#: Time from which on creep is logarithmic, relative to the duration of the run [-].
CREEP_ONSET = 0.1
#: Relative change of a pressure for which the dents are computed again [-].
PRESSURE_STEP = 0.005
#: Smallest stiffness relative to the files; the estimates of a normal prior may be negative [-].
MIN_STIFFNESS = 0.05


class Parameters(NamedTuple):
    """Slices of the parameters, which are deviations from the files and settings."""

    friction: slice  #: of the coefficient of friction [-]
    tube: slice  #: of the stiffness of the tubes, relative [-]
    offsets: slice  #: of the roller travel [m]
    pressure: slice  #: mean and increase of the pressures, relative [-]
    delay: slice  #: time by which poses are older than their stamps [s]
    creep: slice  #: loss of stiffness until the end of the run, relative [-]
    mass: slice  #: of the object's mass, relative [-]
    pose: slice  #: constant error of the measured poses [m, m, rad]
    gain: slice  #: of the gauge and of the modelled squeeze, relative [-]

    @classmethod
    def of(cls, run: MeasuredRun) -> Parameters:
        """Return the slices for the rollers of a run."""
        sizes = [1, 1, run.travel.shape[1], 2, 1, 1, 1, 3, 1]
        ends = np.cumsum(sizes).tolist()
        return cls(*(slice(end - size, end) for end, size in zip(ends, sizes, strict=True)))

    @property
    def size(self) -> int:
        """Return the number of parameters."""
        return self.gain.stop


@dataclass(frozen=True, eq=False)
class Prediction:
    """Pose, squeeze and friction of a run in the model, up to a loss of contact."""

    poses: Array  #: (n, 3) poses [m, rad]
    squeeze: Array  #: (n,) squeeze [N]
    required: Array  #: (n,) required coefficient of friction [-]
    count: int  #: number of intervals before contact is lost; later values repeat the last ones


class Predictor:
    """Predictions of a run for parameters (p,), see `Parameters`; the object alone has weight."""

    def __init__(self, run: MeasuredRun) -> None:
        self.run = run
        self._parts = Parameters.of(run)
        self._rolled: dict[bytes, tuple[Array, int]] = {}
        share = (run.times - run.times[0]) / (run.times[-1] - run.times[0])
        self._share = share
        self._creep = np.log1p(share / CREEP_ONSET) / np.log1p(1.0 / CREEP_ONSET)

    def at(self, values: Array) -> Prediction:
        """
        Return the prediction.

        :raises RunError: the object has no equilibrium near its first pose.
        """
        parts, key = self._parts, values.copy()
        for part in (parts.friction, parts.delay, parts.gain):  # they do not change the motion
            key[part] = 0.0
        if key.tobytes() not in self._rolled:
            self._rolled[key.tobytes()] = self._roll(values)
        table, count = self._rolled[key.tobytes()]
        poses = table[:, :3] + values[parts.pose]
        rates = np.gradient(poses, self.run.times, axis=0)
        return Prediction(
            poses - values[parts.delay] * rates,
            table[:, 3] * (1.0 + values[parts.gain][0]),
            table[:, 4] - values[parts.friction][0],
            count,
        )

    @single_threaded
    def friction_range(self, number: int) -> FrictionRange:
        """Return the friction range of the files' prediction in an interval."""
        grips = self._grips(np.zeros(self._parts.size))
        grip = next(itertools.islice(grips, number, None))
        return find_friction_range(grip, self.run.friction)

    @single_threaded
    def _roll(self, values: Array) -> tuple[Array, int]:
        """Return pose, squeeze and required friction, (n, 5), and the number of intervals."""
        rows = [
            (*grip.state.unknowns[:3].tolist(), grip.squeeze, grip.required_friction)
            for grip in self._grips(values)
        ]
        table = np.array(rows + rows[-1:] * (len(self.run.times) - len(rows)))
        turns = np.round((self.run.poses[0, 2] - table[0, 2]) / (2.0 * np.pi))
        table[:, 2] += 2.0 * np.pi * turns
        return table, len(rows)

    def _grips(self, values: Array) -> Iterator[HeldGrip]:
        """Yield the equilibrium in each interval until contact is lost."""
        run, parts = self.run, self._parts
        travel = run.travel + values[parts.offsets]
        mass = (run.grip.body.mass or 0.0) * (1.0 + values[parts.mass][0])
        stiffness = 1.0 + values[parts.tube][0] - values[parts.creep][0] * self._creep
        stiffness = np.maximum(stiffness, MIN_STIFFNESS)
        level, rise = values[parts.pressure]
        relative = 1.0 + level + rise * (self._share - 0.5)
        pressures = np.outer(relative, tube_pressures(run.robot.description))
        grip: HeldGrip | None = None
        for k in range(len(run.times)):
            forces = run.pull[k], mass * run.gravity[k]
            if grip is None:
                pose = run.grip.body.pose + np.array(-values[parts.pose])
                wrench = self._wrench(*forces, pose[2])
                grip = self._attach(travel[0], pose, wrench, pressures[0], float(stiffness[0]))
            else:
                wrench = self._wrench(*forces, float(grip.state.unknowns[2]))
                grip = _with_tubes(grip, pressures[k], float(stiffness[k]))
                grip = roll_grip(grip, grip.config.moved_to(travel[k]), wrench)
            if grip is None or grip.normal_forces.min() <= 0.0:
                return
            yield grip

    def _attach(
        self, travel: Array, pose: Array, wrench: Array, pressures: Array, stiffness: float
    ) -> HeldGrip:
        """Return the first equilibrium; raise RunError without it."""
        body, members = self.run.grip.body.moved_to(pose), self.run.members
        config = self.run.robot.configuration(travel)
        try:
            return attach_grip(config, body, members, wrench, pressures, stiffness)
        except NotHeldError as error:
            raise RunError(
                f'the model has no equilibrium near the first pose ({pose[0]:.4f}, {pose[1]:.4f}) '
                f'm: {error}; correct the zeros of the rollers, the pose or the size of the object'
            ) from error

    def _wrench(self, pull: Array, weight: Array, angle: float) -> Array:
        """Return the wrench (fx, fy, m) about the origin of the object's frame [N, N m]."""
        middle = self.run.grip.body.center_of_mass
        arm = 0.0j if middle is None else complex(*middle) * np.exp(1j * angle)
        return np.array([*(pull + weight), arm.real * weight[1] - arm.imag * weight[0]])


def _with_tubes(grip: HeldGrip, pressures: Array, stiffness: float) -> HeldGrip:
    """Return a grip with tubes of another stiffness, whose equilibrium `roll_grip` must find."""
    pressed = grip.pressures
    if np.abs(pressures - pressed).max() > PRESSURE_STEP * np.max(pressed):
        pressed = tuple(pressures.tolist())
    return with_tubes(grip, pressed, stiffness)
