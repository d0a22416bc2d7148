# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Runs in MuJoCo with one thing wrong, which `isotruss compare` must name, for docs/afternoon.md.

`python -m studies.measured_runs` simulates eight runs, each with several seeds of the noise,
and prints what the comparison names. Each run is gripped, squeezed, carried, pulled, left at rest,
and pulled until it is lost. MuJoCo has the model's tubes without flattening, so the robot file has
round sections.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
import tempfile
from typing import NamedTuple

from isotruss_ros.core import ConvexObject, Disc, Grip, load_robot, Pose, Robot, tangent_center
from isotruss_ros.core.inputs import LatestInputs, RollerState, StampedInput
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.recording.recorded_cycle import read_cycle
from isotruss_ros.core.recording.recorded_servo import RecordedServo
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
from isotruss_ros.identification.gauge import Gauge
from isotruss_ros.identification.hypotheses import compare_run, ComparedRun, NONE
from isotruss_ros.identification.read_run import read_run
from isotruss_ros.identification.report import WORDS
from isotruss_ros.identification.rolled_run import Parameters
from isotruss_ros.mujoco_plant.options import PlantOptions, RIGID_SECTION_STIFFNESS
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np
from pressed_plants import hold_at_home
from studies.comparison.carrying import squeeze_in

NO_FORCE = np.zeros(2)
MODULE, DIAMETER, INDENTATION = 'north/Z', 0.3, 0.012
#: Coefficient of friction [-] and mass [kg] in the settings.
FRICTION, MASS = 0.8, 1.0
#: Gravity in the plane while it is inclined by 15 degrees [m/s^2]. It acts on the object only.
GRAVITY = np.array([0.0, 2.5])
#: Period of the cycles [s], and number of cycles from one reading of the gauge to the next.
PERIOD, GAUGE_CYCLES = 0.02, 3
#: Number of cycles from one change of the stiffness by creep to the next [-].
CREEP_CYCLES = 20
#: Standard deviations of the poses [m, m, rad], the gauge [N], and the pressures [-].
POSE_NOISE, GAUGE_NOISE, PRESSURE_NOISE = np.array([5e-4, 5e-4, 0.005]), 0.1, 0.005
#: Desired squeezes before and during the carry [N].
SQUEEZES = 9.0, 14.0
#: Force that displaces the object, and rate of the force at the end [N, N/s].
PULL, PULL_RATE = np.array([1.5, 0.0]), 0.6
#: Duration of a leg of the carry [s].
LEG = 2.5
#: Displacement at which the object counts as lost [m].
LOST = 0.05
#: Seeds of the noise; the table states the estimates with the first one.
SEEDS = 0, 1, 2


@dataclass(frozen=True)
class Truth:
    """The simulated robot where it differs from the robot file and the settings."""

    friction: float = FRICTION
    stiffness: float = 1.0  #: factor on EA, EI and GA [-]
    offset: float = 0.0  #: error of the zero of the roller `OFFSET_ROLLER` [m]
    pressure: float = 1.0  #: factor on the pressures [-]
    delay: float = 0.0  #: time by which poses are older than their stamps [s]
    creep: float = 0.0  #: decrease of the stiffness during the run [-]
    mass: float = MASS


OFFSET_ROLLER = 'east/R'
#: What is wrong, with its true value in words, by the hypothesis that must be named.
TRUTHS = {
    'friction': (Truth(friction=0.68), '-0.12'),
    'tube': (Truth(stiffness=0.75), '-25 %'),
    'offsets': (Truth(offset=0.005), '5 mm at one of six'),
    'pressure': (Truth(pressure=0.8), '-20 %'),
    'delay': (Truth(delay=0.16), '160 ms'),
    'creep': (Truth(creep=0.25), '25 % until the end'),
    'mass': (Truth(mass=1.6), '+60 %'),
    'none': (Truth(), ''),
}


class SimulatedRun:
    """
    Run of the control loop with a robot in MuJoCo, which records each cycle and a gauge.

    :ivar texts: records of the cycles, as the node `manipulation` publishes them.
    :ivar gauge: rows (time [s], squeeze [N], pull (2,) [N], gravity (2,) [m/s^2]).
    """

    def __init__(self, robot: Robot, truth: Truth, seed: int) -> None:
        self.texts: list[str] = []
        self.gauge: list[tuple[float, ...]] = []
        self._truth, self._random = truth, np.random.default_rng(seed)
        description = robot.description
        pressures = {name: truth.pressure * p for name, p in description.pressures.items()}
        self._pressures = np.array(list(pressures.values()))
        self._true = replace(description, pressures=pressures, stiffness_scale=truth.stiffness)
        center = tangent_center(robot.home, MODULE, DIAMETER, INDENTATION)
        body = replace(ConvexObject(Disc(DIAMETER), mass=MASS).moved_to((*center, 0.0)))
        options = PlantOptions(friction=truth.friction, object_mass=truth.mass)
        members = members_at(robot, MODULE)
        self.plant: MujocoPlant = hold_at_home(Robot(self._true), body, members, options)
        self._offsets = truth.offset * (np.array(robot.roller_names) == OFFSET_ROLLER)
        self._late: deque[Pose] = deque(maxlen=1 + round(truth.delay / PERIOD))
        grip = Grip(members, body, FRICTION)
        squeeze = SqueezeSettings(SQUEEZES[0])
        settings = ServoSettings(grip, PERIOD, 0.5, squeeze=squeeze)
        self.servo = RecordedServo(robot, settings, LatestInputs())

    def step(
        self, twist: Array, pull: Array, gravity: Array = NO_FORCE, creep: float = 0.0
    ) -> None:
        """Simulate a cycle with a twist [m/s, rad/s] and a pull (2,) [N]; record it."""
        plant, truth, now = self.plant, self._truth, self.plant.time
        weight = truth.mass * gravity
        plant.pull((*(weight + pull), 0.0))
        if truth.creep and len(self.texts) % CREEP_CYCLES == 0:
            scale = 1.0 - truth.creep * creep
            plant.robot = Robot(replace(self._true, stiffness_scale=scale))
        noise = POSE_NOISE * self._random.standard_normal(3)
        self._late.append(Pose(*(plant.object_pose() + noise).tolist()))
        rollers = RollerState(plant.travel - self._offsets, plant.speeds)
        measured = self._pressures * (
            1.0 + PRESSURE_NOISE * self._random.standard_normal(len(self._pressures))
        )
        self.servo.receive(
            rollers=StampedInput(rollers, now),
            pose=StampedInput(self._late[0], now),
            twist=StampedInput(twist, now),
            pressures=StampedInput(tuple(measured.tolist()), now),
        )
        decision = self.servo.decide(now)
        if len(self.texts) % GAUGE_CYCLES == 0:
            force = squeeze_in(plant) + GAUGE_NOISE * self._random.standard_normal()
            self.gauge.append((now, force, *pull.tolist(), *gravity.tolist()))
        self.texts.append(self.servo.describe())
        plant.advance(PERIOD, decision.command.roller_velocities)


class Cycle(NamedTuple):
    """Command and load of a cycle."""

    twist: Array  #: (3,) twist of the object [m/s, rad/s]
    pull: Array  #: (2,) force on the object besides its weight [N]
    squeeze: float  #: desired squeeze [N]
    gravity: Array = NO_FORCE  #: (2,) gravity in the plane [m/s^2]


def rates(duration: float) -> Array:
    """Return the speeds in all cycles of a motion from rest to rest, relative to the mean."""
    count = round(duration / PERIOD)
    return 1.0 - np.cos(2.0 * np.pi * (np.arange(count) + 0.5) / count)


def protocol() -> Iterator[Cycle]:
    """Yield the cycles of a run up to the pull that ends it."""
    still, none = np.zeros(3), NO_FORCE
    yield from [Cycle(still, none, SQUEEZES[0])] * round(1.0 / PERIOD)
    yield from [Cycle(still, none, SQUEEZES[1])] * round(2.0 / PERIOD)
    for step in ((-0.06, -0.05, 0.0), (0.06, 0.05, 0.0), (0.0, 0.0, 0.3), (0.0, 0.0, -0.3)):
        for rate in rates(LEG):
            yield Cycle(rate * np.array(step) / LEG, none, SQUEEZES[1])
    for share in rates(3.0):
        yield Cycle(still, 0.5 * share * PULL, SQUEEZES[1])
    for share in rates(4.0):
        yield Cycle(still, none, SQUEEZES[1], 0.5 * share * GRAVITY)
    yield from [Cycle(still, none, SQUEEZES[1])] * round(4.0 / PERIOD)


def simulate(robot: Robot, truth: Truth, seed: int) -> SimulatedRun:
    """Return a run of the protocol, and of a pull out of the grip until the object is lost."""
    run, cycles = SimulatedRun(robot, truth, seed), list(protocol())
    for number, cycle in enumerate(cycles):
        force = run.servo.settings.squeeze.force
        if cycle.squeeze != force:
            squeeze = replace(run.servo.settings.squeeze, force=cycle.squeeze)
            run.servo.apply(replace(run.servo.settings, squeeze=squeeze))
        run.step(cycle.twist, cycle.pull, cycle.gravity, number / len(cycles))
    before = np.array(run.plant.object_pose())
    pull = np.zeros(2)
    while np.hypot(*(run.plant.object_pose() - before)[:2]) < LOST:
        run.step(np.zeros(3), pull, creep=1.0)
        pull = pull - (0.0, PULL_RATE * PERIOD)
    return run


def write_robot_file(folder: Path) -> Path:
    """Write the robot file of the nine-member robot with round sections; return its path."""
    text = Path(load_robot('nine_member').description.source).read_text(encoding='utf-8')
    path = folder / 'round.yaml'
    round_sections = f'tube:\n  local_stiffness: {RIGID_SECTION_STIFFNESS}\n'
    path.write_text(text.replace('tube:\n', round_sections, 1), encoding='utf-8')
    return path


def compare(wrong: str, seed: int) -> ComparedRun:
    """Return the comparison of a run in which one thing is wrong with the model of its records."""
    with tempfile.TemporaryDirectory() as folder:
        robot = load_robot(str(write_robot_file(Path(folder))))
        run = simulate(robot, TRUTHS[wrong][0], seed)
        rows = np.array(run.gauge)
        gauge = Gauge('gauge', rows[:, 0], rows[:, 1], rows[:, 2:4], rows[:, 4:])
        return compare_run(read_run(map(read_cycle, run.texts), None, gauge))


def describe(compared: ComparedRun) -> str:
    """Return the most significant estimate of the named parameter, and its evidence."""
    if compared.named == NONE:
        return ' | '
    best = compared.hypotheses[compared.named]
    part = getattr(Parameters.of(compared.run), best.name)
    values, deviations = best.estimate[part], best.deviation[part]
    most = int(np.argmax(np.abs(values) / deviations))
    _, factor, unit = WORDS[best.name]
    shown = f'{factor * values[most]:+.3g} ± {factor * deviations[most]:.2g}{unit}'
    return f'{shown} | {best.evidence:.0f}'


def main() -> None:
    """Print the named hypothesis of each run."""
    headings = 'wrong', 'named', 'true', 'estimate', 'evidence', f'named, of {len(SEEDS)} seeds'
    print(f'| {" | ".join(headings)} |\n| --- | --- | --- | --- | ---: | ---: |')
    right = 0
    for wrong, (_, words) in TRUTHS.items():
        runs = [compare(wrong, seed) for seed in SEEDS]
        count = sum(run.named == wrong for run in runs)
        right += count
        row = wrong, runs[0].named, words, describe(runs[0]), str(count)
        print(f'| {" | ".join(row)} |', flush=True)
    print(f'{right} of {len(SEEDS) * len(TRUTHS)} are named')


if __name__ == '__main__':
    main()
