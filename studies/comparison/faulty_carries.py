# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Objects carried in MuJoCo by a loop with halts, under several simultaneous faults.

`python -m studies.comparison.faulty_carries` prints a line for each carry and the figures of all,
in some ten minutes; with `--drawn 60 --clean 10 --lost 20 --nothing 10 --page docs/benchmarks.md`
in half an hour, and replaces the table of that page.
"""

from __future__ import annotations

import argparse
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile
import math
from pathlib import Path
import sys
import time
from typing import NamedTuple

from isotruss_ros.calibration.home import move_home
from isotruss_ros.core import Grip, place_between, Pose, Robot, Status
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.planning.foresee_path import foresee_path
from isotruss_ros.core.servo.servo_settings import SqueezeSettings
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np
from pressed_plants import hold_at_home, round_robot, soften
from studies.comparison.carrying import RATE, rates, Regulated, squeeze_in
from studies.comparison.random_carries import BOX, DISC, draw_grip, FRICTION, LONGEST

#: Rest before and after the path [s]; number of its legs [-], time [s] and largest step of a leg
#: [m, rad].
REST, LEGS, LEG_TIME, REACH = 2.0, 2, 3.0, np.array([0.04, 0.04, 0.12])
#: Faults, and smallest number of them in a draw [-].
FAULTS, LEAST = ('roller offsets', 'slip', 'stiffness', 'friction', 'poses', 'pull'), 3
#: Roller offsets [m], roller slip [-], factors on the stiffness of the tubes [-], and ratio of
#: the true friction to the one that the loop assumes [-].
ZEROS, SLIP, STIFFNESS, LESS_FRICTION = 0.01, 0.02, (0.6, 1.5), 0.7
#: Pull relative to the slip margin [-], the same for a pull that must break the grip [-], and
#: duration [s].
PULL, LOSING, PULL_TIME = 0.5, 4.0, 1.5
#: Time of the first pose [s].
BEGIN = 0.2
#: Time with fewer than two contacts after which an object counts as lost [s].
LOST_TIME = 0.2
#: Used share of friction at which a contact slips [-], and position error of a displaced object
#: [m].
ALL, OFF = 0.98, 0.005
#: Smallest fraction of its path that an object has executed at its arrival [-].
ARRIVED = 0.95
DRAWN, CLEAN, LOST, NOTHING = 'drawn', 'clean', 'lost', 'nothing'


class Sensors(NamedTuple):
    """Quality of the pose measurements."""

    noise: tuple[float, float]  #: standard deviations [m, rad]
    period: float  #: period of the poses [s]
    late: float  #: delay of the poses beyond their stamps [s]


GOOD = Sensors((2e-4, math.radians(0.1)), 0.02, 0.0)
POOR = Sensors((1e-3, math.radians(0.5)), 0.05, 0.03)


@dataclass(frozen=True)
class Draw:
    """Random faults of a robot and its sensors."""

    names: tuple[str, ...]
    zeros: float | Array
    slip: float = 0.0
    stiffness: float = 1.0
    friction: float = FRICTION  #: coefficient of friction that the loop assumes [-]
    sensors: Sensors = GOOD
    pull: float = 0.0  #: pull relative to the slip margin [-]

    @classmethod
    def of(cls, kind: str, rollers: int, rng: np.random.Generator) -> Draw:
        """
        Return the faults for a kind of carry.

        :param kind: kind of the carry; only `DRAWN` has several faults.
        :param rollers: number of rollers.
        :param rng: random number generator.
        """
        if kind != DRAWN:
            return cls((), 0.0, pull=LOSING if kind == LOST else 0.0)
        chosen = rng.permutation(len(FAULTS))[: rng.integers(LEAST, len(FAULTS) + 1)]
        names = tuple(FAULTS[i] for i in sorted(chosen))
        return cls(
            names,
            ZEROS * rng.normal(size=rollers) if 'roller offsets' in names else 0.0,
            SLIP if 'slip' in names else 0.0,
            rng.choice(STIFFNESS) if 'stiffness' in names else 1.0,
            FRICTION / (LESS_FRICTION if 'friction' in names else 1.0),
            POOR if 'poses' in names else GOOD,
            PULL if 'pull' in names else 0.0,
        )


@dataclass
class Carry:
    """Result of one object's carry."""

    kind: str
    shape: str
    seed: int
    draw: Draw
    halt: Status | None = None
    message: str = ''
    halted: float = math.inf  #: time of the halt [s]
    refused: bool = False  #: whether the loop halted before it had an equilibrium
    lost: float = math.inf  #: time of the loss [s]
    used: float = math.inf  #: time at which a contact first used all friction [s]
    way: float = 0.0  #: length of the executed path until the halt [m]
    length: float = 0.0  #: length of the whole path [m]
    off: float = 0.0  #: final position error relative to the executed twists [m]
    squeeze: float = 0.0  #: true final squeeze [N]
    target: float = 0.0  #: desired squeeze [N]
    believed: tuple[float, float] = (math.nan, math.inf)  #: final squeeze estimate, deviation [N]
    cycle: float = 0.0  #: median processor time of a cycle [s]
    walk: float = 0.0  #: largest `slip_deviations` of the belief until the halt [-]
    innovations: list[float] = field(default_factory=list)  #: normalised squared innovations [-]

    @property
    def end(self) -> str:
        """Return a text with the result."""
        if self.lost < math.inf:
            late = self.halted - self.lost
            return f'lost, reported {late:+.2f} s' if late < math.inf else 'lost, not reported'
        if self.halt is None:
            arrived = self.way >= ARRIVED * self.length
            return 'arrived' if arrived else 'halted by limits, held'
        if self.refused:
            return 'refused'
        strict = self.halted < self.used and self.off < OFF
        return 'halted, strictly false' if strict else 'halted, held'

    def row(self) -> str:
        """Return a line of a table."""
        believed, deviation = self.believed
        away = (believed - self.squeeze) / deviation
        median = float(np.median(self.innovations)) if self.innovations else math.nan
        return (
            f'{self.kind} {self.shape} {self.seed}: {", ".join(self.draw.names) or "-"}: '
            f'{self.end}; path {1e3 * self.way:.0f} of {1e3 * self.length:.0f} mm, off '
            f'{1e3 * self.off:.1f} mm; squeeze {self.squeeze:.1f} of {self.target:.1f} N, '
            f'believed {believed:.1f} ± {deviation:.1f} ({away:+.1f}); innovation {median:.2f}; '
            f'walk {self.walk:.1f}; cycle {1e3 * self.cycle:.2f} ms'
            + (f'; {self.halt.name}: {self.message}' if self.halt is not None else '')
        )


class Loop(Regulated):
    """
    Servo of `manipulation` with random faults.

    :param plant: plant that holds the object.
    :param robot: robot that the control loop assumes.
    :param grip: grip of the object according to the model.
    :param settings: settings of the squeeze control.
    :param draw: faults of robot and sensors.
    :param rng: random number generator of the noise.
    """

    def __init__(
        self,
        plant: MujocoPlant,
        robot: Robot,
        grip: Grip,
        settings: SqueezeSettings,
        draw: Draw,
        rng: np.random.Generator,
    ) -> None:
        super().__init__(plant, robot, grip, settings)
        self._draw, self.rng = draw, rng
        self._waiting: deque[tuple[float, Pose]] = deque()
        self._next, self._stamped = 0.0, -1.0
        self.times: list[float] = []

    def command(self, twist: Array, error: Array) -> Array:
        """Return the velocities of the tubes, which slip at the rollers."""
        servo, now, slip = self.servo, self.plant.time, self._draw.slip
        servo.receive(
            rollers=StampedInput(
                RollerState(self.plant.travel / (1.0 - slip), self.plant.speeds / (1.0 - slip)),
                now,
            )
        )
        self._measure(now)
        servo.receive(twist=StampedInput(tuple(twist), now))
        begin = time.process_time()
        decision = servo.decide(now)
        self.times.append(time.process_time() - begin)
        self.decision, self.scale = decision, decision.command.scale
        return (1.0 - slip) * decision.command.roller_velocities

    def _measure(self, now: float) -> None:
        """Measure the pose when it is due; it is delayed and stamped on arrival."""
        (along, turned), period, late = self._draw.sensors
        if now >= self._next - 1e-9:
            self._next = now + period
            noise = np.array([along, along, turned]) * self.rng.standard_normal(3)
            self._waiting.append((now + late, self.place() + noise))
        while self._waiting and self._waiting[0][0] <= now + 1e-9:
            when, pose = self._waiting.popleft()
            self.servo.receive(pose=StampedInput(Pose(*pose.tolist()), when))

    def place(self) -> Array:
        """Return the pose of the object, (3,) [m, rad]."""
        return np.array(self.plant.object_pose())


class _Nothing(Loop):
    """Loop that measures the initial pose of an object that is not gripped."""

    def __init__(self, *arguments: object) -> None:
        super().__init__(*arguments)
        self._lies = super().place()
        self.plant.hold_object((5.0, 5.0, 0.0))

    def place(self) -> Array:
        """Return the initial pose of the object."""
        return self._lies


def carry(kind: str, shape: str, seed: int) -> Carry:
    """
    Carry one object along a random path.

    :param kind: kind of the carry: drawn, clean, lost or nothing.
    :param shape: shape of the object, `DISC` or `BOX`.
    :param seed: seed of the random numbers.
    """
    rng = np.random.default_rng([seed, (DISC, BOX).index(shape)])
    robot = round_robot()
    draw = Draw.of(kind, len(robot.roller_names), rng)
    true = Robot(move_home(soften(robot, draw.stiffness), np.zeros(6) + draw.zeros))
    while True:
        grip, held = draw_grip(robot, shape, rng)
        legs = rng.uniform(-1.0, 1.0, (LEGS, 3)) * REACH
        poses = np.array(held.pose) + np.vstack([np.zeros(3), np.cumsum(legs, axis=0)])
        if foresee_path(held, FRICTION, poses).why:
            continue
        plant, body = _hold(true, grip)
        if squeeze_in(plant):  # it may leave before there is a loop
            break
    settings = SqueezeSettings(held.squeeze)
    given = replace(grip, body=body, friction=draw.friction)
    make = _Nothing if kind == NOTHING else Loop
    loop = make(plant, robot, given, settings, draw, rng)
    length = float(np.hypot(*legs[:, :2].T).sum())
    found = Carry(kind, shape, seed, draw, target=held.squeeze, length=length)
    _follow(loop, legs, held, found)
    return found


def _hold(true: Robot, grip: Grip) -> tuple[MujocoPlant, object]:
    """Return a plant that holds the object at a random indentation."""
    body, angle = grip.body, grip.body.pose.angle
    body = place_between(true.home, grip.members, body.shape, angle, 0.01).body
    body = replace(body, mass=0.5, friction=FRICTION)
    return hold_at_home(true, body, grip.members, PlantOptions()), body


def _follow(loop: Loop, legs: Array, held: HeldGrip, found: Carry) -> None:
    """Follow the path and record events."""
    plant, draw = loop.plant, found.draw
    direction = loop.rng.uniform(0.0, 2.0 * math.pi)
    size = draw.pull * held.slip_margin(FRICTION)
    pull = size * np.array([math.cos(direction), math.sin(direction), 0.0])
    twists = [np.zeros((round(REST * RATE), 3))]
    twists += [np.outer(rates(LEG_TIME), leg / LEG_TIME) for leg in legs]
    twists += [np.zeros((round(REST * RATE), 3))]
    goal, begin, alone = loop.place(), plant.time, 0
    squeezes, rows = [], np.vstack(twists)
    done, cycles = 0.0, 0
    while done < len(rows) and cycles < LONGEST * len(rows):
        twist, now = rows[int(done)], plant.time - begin
        pulled = REST + LEG_TIME <= now < REST + LEG_TIME + PULL_TIME
        plant.pull(pull if pulled else np.zeros(3))
        loop.step(twist if found.halt is None else np.zeros(3))
        # Like the path follower, a leg takes longer where limits slow it.
        done += loop.scale if twist.any() and found.halt is None else 1.0
        cycles += 1
        goal = goal + loop.scale * twist / RATE
        off = float(np.hypot(*(goal - loop.place())[:2]))
        status = loop.decision.command.status
        if found.halt is None:
            found.off = off
            found.way += loop.scale * float(np.hypot(*twist[:2])) / RATE
        if found.halt is None and now > BEGIN and status > Status.HALT_NO_TWIST:
            found.halt, found.halted, found.message = status, now, loop.decision.message
            found.refused = not found.innovations
        forces = plant.contact_forces().values()
        share = [abs(f.friction) / max(FRICTION * f.normal, 1e-9) for f in forces]
        if now > BEGIN and max(share, default=1.0) > ALL:
            found.used = min(found.used, now)
        squeezes.append(squeeze_in(plant))
        alone = alone + 1 if squeezes[-1] == 0.0 else 0
        if alone == round(LOST_TIME * RATE):
            found.lost = now - LOST_TIME
        belief = loop.control.tracker.belief
        if belief is not None and belief.state.innovation not in found.innovations[-1:]:
            found.innovations.append(belief.state.innovation)
            if found.halt is None:
                found.walk = max(found.walk, belief.slip_deviations)
    found.squeeze = float(np.mean(squeezes[-round(0.5 * RATE) :]))
    found.believed = loop.decision.squeeze or (math.nan, math.inf)
    found.cycle = float(np.median(loop.times[round(REST * RATE) : -round(REST * RATE)]))


def summarise(carries: Sequence[Carry]) -> list[str]:
    """
    Return sentences with the statistics of all carries.

    :param carries: results of the carries.
    """
    lines = []
    drawn = [one for one in carries if one.kind == DRAWN]
    held = [one for one in drawn if one.lost == math.inf]
    if drawn:
        strict = sum(one.end == 'halted, strictly false' for one in held)
        refused = sum(one.end == 'refused' for one in held)
        halted = sum('halted' in one.end for one in held)
        lines.append(
            f'drawn: {len(drawn)}, held {len(held)}, of these refused at the start {refused}, '
            f'halted {halted}, strictly false {strict}'
        )
        sure = [one for one in held if one.believed[1] < math.inf]
        inside = sum(abs(one.believed[0] - one.squeeze) <= 2.0 * one.believed[1] for one in sure)
        lines.append(f'squeeze within two stated deviations: {inside} of {len(sure)} held')
    lost = [one for one in carries if one.kind != NOTHING and one.lost < math.inf]
    late = [one.halted - one.lost for one in lost]
    if late:
        told = sum(each <= 0.2 for each in late)
        lines.append(f'lost: {len(late)}, told within 0.2 s {told}, never {late.count(math.inf)}')
    ways = [one.way for one in carries if one.kind == NOTHING]
    if ways:
        lines.append(f'nothing gripped: told after {1e3 * max(ways):.0f} mm at most')
    for one in carries:
        if one.kind == CLEAN:
            share = 100.0 * (one.squeeze / one.target - 1.0)
            slid = f', slid at {one.used:.1f} s' if one.used < math.inf else ''
            lines.append(
                f'clean {one.shape} {one.seed}: {1e3 * one.off:.1f} mm off, '
                f'squeeze {share:+.1f} %{slid}'
            )
    arrived = [one for one in held if one.end == 'arrived']
    if arrived:
        walk = max(one.walk for one in arrived)
        least = 100.0 * min(one.way / one.length for one in arrived)
        lines.append(
            f'those that arrived: walk {walk:.1f} deviations at most, '
            f'{least:.0f} % of the path executed at least'
        )
    medians = [float(np.median(one.innovations)) for one in carries if one.innovations]
    if medians:
        lines.append(f'median squared innovation: {min(medians):.2f} to {max(medians):.2f}')
    lines.append(f'cycle: {1e3 * np.median([one.cycle for one in carries]):.2f} ms')
    return lines


def tabulate(carries: Sequence[Carry]) -> list[str]:
    """
    Return the table of `docs/benchmarks.md` as Markdown, with a row for each fault.

    :param carries: results of the carries.
    """
    groups = [(name, [c for c in carries if name in c.draw.names]) for name in FAULTS]
    kinds = {CLEAN: 'none', LOST: 'a pull that breaks the grip', NOTHING: 'nothing gripped'}
    groups += [(words, [c for c in carries if c.kind == kind]) for kind, words in kinds.items()]
    headings = ('fault', 'carries', 'arrived', 'refused', 'halted, held', 'lost')
    headings += ('loss reported after [s]', 'reported after [mm]')
    rows = [f'| {" | ".join(headings)} |', f'|{" --- |" * len(headings)}']
    for name, some in groups:
        if not some:
            continue
        lost = [c for c in some if c.lost < math.inf and c.kind != NOTHING]
        late = f'{max(c.halted - c.lost for c in lost):+.2f}' if lost else '–'
        ways = [1e3 * c.way for c in some if c.kind == NOTHING]
        words = ('arrived', 'refused', 'halted', 'lost')
        counts = ' | '.join(str(sum(word in c.end for c in some)) for word in words)
        way = f'{max(ways):.0f}' if ways else '–'
        rows.append(f'| {name} | {len(some)} | {counts} | {late} | {way} |')
    return rows


def write_table(page: Path, rows: Sequence[str]) -> None:
    """
    Replace the table of a page that has the same first heading.

    :param page: Markdown file.
    :param rows: lines of the table.
    :raises ValueError: the page has no such table.
    """
    lines = page.read_text(encoding='utf-8').split('\n')
    heading = rows[0].split('|')[1]
    first = next((i for i, line in enumerate(lines) if line.startswith(f'|{heading}|')), None)
    if first is None:
        raise ValueError(f'{page}: no table whose first heading is {heading.strip()!r}')
    count = len(list(takewhile(lambda line: line.startswith('|'), lines[first:])))
    lines[first : first + count] = rows
    page.write_text('\n'.join(lines), encoding='utf-8')


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Print the results of random objects.

    :param arguments: arguments of the command line; None: those of the process.
    :return: 0.
    """
    parser = argparse.ArgumentParser(
        prog='python -m studies.comparison.faulty_carries', description=__doc__
    )
    counts = {DRAWN: 12, CLEAN: 2, LOST: 4, NOTHING: 2}
    for kind, count in counts.items():
        parser.add_argument(f'--{kind}', type=int, default=count, help=f'carries; default {count}')
    parser.add_argument('--first', type=int, default=0, help='first seed; default 0')
    parser.add_argument('--page', type=Path, help='page whose table is replaced')
    options = parser.parse_args(arguments)
    found = []
    for kind in counts:
        for k in range(getattr(options, kind)):
            shape = (DISC, BOX)[k % 2]
            found.append(carry(kind, shape, options.first + k // 2))
            print(found[-1].row(), flush=True)
    print('\n'.join([*summarise(found), '', *tabulate(found)]))
    if options.page is not None:
        write_table(options.page, tabulate(found))
    return 0


if __name__ == '__main__':
    sys.exit(main())
