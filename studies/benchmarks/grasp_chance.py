# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Chance that an object is held: against drawn equilibria, its time, and in MuJoCo.

Grasps are planned for the objects of the benchmark grasp_planner, then friction, load, position
and uncertainty are random. In MuJoCo, robots are drawn from the uncertainty. Each follows the path
to the grasp that was planned for the nominal and for the uncertain robot, at the planned speed in
open loop, and carries the free object under a drawn load. It has failed if the object is lost or a
tube wrinkles. The utilisation is that of the hinges' moments in MuJoCo, times the ratio
of the model to MuJoCo for the nominal robot, because segments flatten the maximum.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice

from isotruss_ros.core import (
    ConvexObject,
    Disc,
    GraspRequirements,
    IsotrussError,
    place_between,
    plan_grasps,
    Polygon,
    Robot,
    settle_grasp,
    Uncertainty,
)
from isotruss_ros.core.chance.probability import find_chance
from isotruss_ros.core.errors import ConfigurationError, GraspError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.grasp_gradient import GraspParameters
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.settled_grasp import SettledGrasp
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.planning.foresee_path import foresee_path
from isotruss_ros.core.planning.grasp_plan import export_path, PlannedGrasp
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np
from pressed_plants import mesh, round_robot
from studies.benchmarks.grasp_planner import objects
from studies.benchmarks.measuring import part, Table, timed
from studies.comparison.carrying import RATE, squeeze_in

#: Grasps in each tenth of the chance, draws for each grasp, and largest number of grasps tried.
GRASPS, DRAWS, TRIED = part(4), part(500), part(1000)
ROBOTS, OBJECTS, PLANNED, PLANS = part(4), part(21), part(50), part(30)
#: Objects of the grasps that are planned for the largest chance, and samples of each.
BEST, SAMPLES = part(8), 200
FRICTION, LOST = 0.5, 0.05
CARRY = ((0.0, 0.0, 0.0), (0.05, 0.03, 0.0), (0.0, 0.05, 0.15))
#: Uncertainty of the robots in MuJoCo.
UNCERTAIN = Uncertainty(stiffness=0.2, roller_offset=0.005, position=0.002, force=0.5, moment=0.02)


def outline(name: str, diameter: float) -> Shape:
    """Return a disc, a box or a hexagon."""
    if name == 'disc':
        return Disc(diameter)
    count = {'box': 4, 'hexagon': 6}[name]
    corners = 0.5 * diameter * np.exp(2j * np.pi * np.arange(count) / count)
    return Polygon(np.column_stack([corners.real, corners.imag]).tolist(), corner_radius=0.01)


def random_grasps(name: str) -> Iterator[tuple[SettledGrasp, Uncertainty]]:
    """Yield settled grasps of discs, boxes or hexagons, each with an uncertainty."""
    rng, robot = np.random.default_rng(7), round_robot()
    needs = GraspRequirements(count=1)
    found = [plan_grasps(robot.home, body, needs, thorough=False) for body in objects(PLANS)]
    plans = [plan[0] for plan in found if plan.grasps]
    while True:
        grasp = plans[rng.integers(len(plans))]
        x, y, _ = grasp.grip.body.pose
        shape = outline(name, grasp.grip.body.shape.diameter)
        try:
            body = ConvexObject(shape, (x, y, 0.0))
            if name != 'disc':
                angle, depth = rng.uniform(0.0, np.pi), rng.uniform(0.005, 0.02)
                body = place_between(grasp.config, grasp.members, shape, angle, depth).body
            shift = rng.uniform(0.0, 0.008) * np.exp(2j * np.pi * rng.random())
            x, y, angle = body.pose
            body = body.moved_to((x + shift.real, y + shift.imag, angle))
            wrench = rng.normal(size=3) * (1.0, 1.0, 0.1)
            wrench *= rng.uniform(0.0, grasp.slip_margin) / np.linalg.norm(wrench[:2])
            free = settle_grasp(grasp.config, body, 1.0, wrench, members=grasp.members)
            if free.equilibrium is None:
                continue
            friction = rng.uniform(0.8, 1.6) * free.required_friction
            settled = settle_grasp(grasp.config, body, friction, wrench, members=grasp.members)
        except IsotrussError:
            continue
        yield (
            settled,
            Uncertainty(
                friction=rng.uniform(0.03, 0.15),
                stiffness=rng.uniform(0.05, 0.3),
                roller_offset=rng.choice([0.0013, 0.005, 0.01]),
                force=rng.choice([0.0, 0.5]),
            ),
        )


def draw_afresh(settled: SettledGrasp, change: np.ndarray) -> SettledGrasp:
    """Return a grasp with changes of all parameters, by its robot file and `settle_grasp`."""
    inputs = (settled.equilibrium or settled.lost).inputs
    columns, names = GraspParameters.of(inputs.config), inputs.config.robot.member_names
    stiffness = max(1.0 + change[columns.stiffness], 0.05)
    robot = Robot(replace(inputs.config.robot.description, stiffness_scale=stiffness))
    body = inputs.body.scaled(1.0 + change[-1])
    return settle_grasp(
        robot.home.moved_to(inputs.config.roller_positions + change[columns.rollers]),
        body.moved_to(np.array(body.pose) + change[columns.place]),
        max(settled.friction + change[columns.friction], 0.0),
        inputs.wrench + change[columns.wrench],
        pressure=inputs.pressures + change[columns.pressures],
        members=None if inputs.members is None else [names[i] for i in inputs.members],
    )


def held_share(settled: SettledGrasp, uncertainty: Uncertainty, seed: int) -> float:
    """Return the share of drawn equilibria in which the object is held."""
    rng, held = np.random.default_rng(seed), []
    covariance = uncertainty.covariance(settled.equilibrium)
    for change in rng.multivariate_normal(np.zeros(len(covariance)), covariance, DRAWS):
        try:
            held.append(draw_afresh(settled, change).held)
        except ConfigurationError:  # the robot has a configuration
            continue
    return float(np.mean(held))


def _calibration(name: str) -> Table:
    bins: list[list[tuple[float, float]]] = [[] for _ in range(10)]
    for i, (settled, uncertainty) in enumerate(islice(random_grasps(name), TRIED)):
        try:
            chance = settled.chance(uncertainty).probability
        except GraspError:  # the equilibrium is neutral
            continue
        pairs = bins[min(int(10.0 * chance), 9)]
        if len(pairs) < GRASPS:
            pairs.append((chance, held_share(settled, uncertainty, i)))
        if min(map(len, bins)) == GRASPS:
            break
    rows = []
    for tenth, pairs in enumerate(bins):
        if pairs:
            mean, share = np.mean(pairs, axis=0)
            label = f'{0.1 * tenth:.1f} to {0.1 * (tenth + 1):.1f}'
            values = f'{mean:.3f}', f'{share:.3f}', f'{share - mean:+.3f}'
            rows.append((label, str(len(pairs)), *values))
    header = ('chance', 'grasps', 'predicted', 'held', 'difference')
    return Table(f'Predicted chance and {DRAWS} draws of each grasp: {name}', header, rows)


def _best() -> Table:
    rows, robot = [], round_robot()
    for i, body in enumerate(objects(BEST)):
        needs = GraspRequirements(friction=FRICTION, count=1)
        plan = plan_grasps(robot.home, body, needs, thorough=False, uncertainty=Uncertainty())
        if plan.grasps:
            grasp = plan[0]
            placed = grasp.grip.body
            settled = settle_grasp(grasp.config, placed, FRICTION, members=grasp.members)
            share = held_share(settled, Uncertainty(), i)
            first, drawn = (settled.chance(Uncertainty(), samples=n) for n in (0, SAMPLES))
            values = grasp.chance.probability, first.probability, drawn.probability, share
            rows.append((str(i + 1), *(f'{value:.3f}' for value in values)))
    header = ('object', 'plan', 'first order', f'{SAMPLES} samples', 'held')
    return Table('Grasps that are planned for the largest chance', header, rows)


def _times() -> Table:
    settled, uncertainty = next(random_grasps('disc'))
    grip, members = settled.equilibrium, settled.equilibrium.member_names
    body, count = grip.measured, part(200)

    def settle() -> SettledGrasp:
        return settle_grasp(grip.config, body, settled.friction, members=members)

    alone = np.median([timed(settle)[0] for _ in range(part(50))])
    first = np.median(
        [timed(lambda: settled.chance(uncertainty, samples=0))[0] for _ in range(part(50))]
    )
    drawn = timed(lambda: settled.chance(uncertainty, samples=count))[0] * 200.0 / count
    needs, spent = GraspRequirements(count=1), np.zeros(2)
    for body_ in objects(PLANNED):
        for i, given in enumerate((None, Uncertainty())):
            spent[i] += timed(
                lambda body=body_, given=given: plan_grasps(
                    round_robot().home, body, needs, thorough=False, uncertainty=given
                )
            )[0]
    rows = (
        ('first order / settle', f'{first / alone:.2f}'),
        ('200 samples / settle', f'{drawn / alone:.0f}'),
        (f'plan of {PLANNED} objects / nominal plan', f'{spent[1] / spent[0]:.2f}'),
    )
    return Table('Processor time', ('ratio', 'value'), rows)


@dataclass(frozen=True)
class Carry:
    """Planned grasp with the equilibria along the path on which the object is carried."""

    grasp: PlannedGrasp
    passed: list[HeldGrip]

    @classmethod
    def plan(cls, body: ConvexObject, uncertainty: Uncertainty | None) -> Carry | None:
        """Return the best grasp; None if there is none."""
        needs = GraspRequirements(friction=FRICTION, count=1, carry=CARRY)
        home = round_robot().home
        plan = plan_grasps(home, body, needs, max_rounds=1, uncertainty=uncertainty)
        if not plan.grasps:
            return None
        held = plan[0].equilibrium
        at_rest = attach_grip(
            held.config,
            held.body,
            held.members,
            stiffness=held.stiffness,
            pressure=held.pressures,
        )
        return cls(plan[0], foresee_path(at_rest, FRICTION, np.array(CARRY)).grips)

    @property
    def chance(self) -> float:
        """Return the predicted chance."""
        covariance = UNCERTAIN.covariance(self.passed[0])
        return find_chance(self.passed, FRICTION, covariance).probability

    def simulate(self, body: ConvexObject, z: np.ndarray) -> tuple[bool, float]:
        """Return whether MuJoCo's object is lost, and the largest utilisation [-]."""
        file, offsets = round_robot().description, UNCERTAIN.roller_offset * z[4:10]
        pressures = {
            name: value * (1.0 + UNCERTAIN.pressure * z[1 + i])
            for i, (name, value) in enumerate(file.pressures.items())
        }
        scale = max(1.0 + UNCERTAIN.stiffness * z[0], 0.3)
        robot = Robot(replace(file, stiffness_scale=scale, pressures=pressures))
        x, y = np.array(body.pose[:2]) + UNCERTAIN.position * z[11:13]
        disc = ConvexObject.disc((x, y), body.shape.diameter * (1.0 + UNCERTAIN.size * z[13]))
        friction = max(FRICTION + UNCERTAIN.friction * z[10], 0.02)
        options = PlantOptions(friction=friction, ground_friction=0.5)
        plant = MujocoPlant(robot, disc, options, mesh(robot, self.grasp.members))
        exported = export_path(self.grasp)
        _follow(plant, np.outer([0.0, 1.0], offsets), np.array([0.0, 0.3]))
        _follow(plant, np.array(exported['path']) + offsets, np.array(exported['times']))
        plant.settle(1.0)
        start = np.array(plant.object_pose())
        plant.pull(z[14:17] * (UNCERTAIN.force, UNCERTAIN.force, UNCERTAIN.moment))
        rows = np.array([grip.config.roller_positions for grip in self.passed]) + offsets
        used = max(_utilisation(plant), _follow(plant, rows, 0.08 * np.arange(len(rows))))
        plant.settle(1.0)
        way = np.subtract(self.passed[-1].pose, self.passed[0].pose)
        off = np.hypot(*(np.array(plant.object_pose()) - start - way)[:2])
        return squeeze_in(plant) == 0.0 or off > LOST, max(used, _utilisation(plant))


def _follow(plant: MujocoPlant, rows: np.ndarray, times: np.ndarray) -> float:
    """Move the rollers along a path; return the largest utilisation on the way."""
    used = 0.0
    for k in range(int(np.ceil(times[-1] * RATE))):
        goal = np.array([np.interp((k + 1) / RATE, times, column) for column in rows.T])
        plant.advance(1.0 / RATE, RATE * (goal - plant.travel))
        if k % 10 == 0:
            used = max(used, _utilisation(plant))
    return used


def _utilisation(plant: MujocoPlant) -> float:
    """Return the largest moment of a hinge in MuJoCo divided by the wrinkling moment [-]."""
    model, positions, joints = plant.model, plant.data.qpos, plant._spring_joint
    bends = model.jnt_type[joints] == 3  # hinges
    moments = np.abs(model.jnt_stiffness[joints] * positions[model.jnt_qposadr[joints]])[bends]
    file, topology = plant.robot.description, plant.robot.topology
    radius = 0.5 * file.tube_diameter
    first, slides = plant._first_joint, plant._first_slide
    pulls = model.jnt_stiffness[first] * (positions[slides] - model.qpos_spring[slides])
    walls = np.pi * radius**2 * np.array(list(file.pressures.values()))[topology.tube]
    wrinkling = 0.5 * radius * (walls + np.minimum(pulls, 0.0))
    return float((moments / wrinkling[plant._spring_member[bends]]).max())


def _carried() -> Table:
    counts, predicted, robots = np.zeros((2, 3), dtype=int), np.zeros(2), 0
    for k, body in enumerate(objects(OBJECTS)):
        carries = [Carry.plan(body, given) for given in (None, UNCERTAIN)]
        if None in carries:
            continue
        robots += ROBOTS
        for i, carry in enumerate(carries):
            model = max(float(grip.sections.used.max()) for grip in carry.passed)
            ratio = model / carry.simulate(body, np.zeros(17))[1]
            predicted[i] += ROBOTS * (1.0 - carry.chance)
            for r in range(ROBOTS):
                z = np.random.default_rng((k, r)).normal(size=17)
                lost, used = carry.simulate(body, z)
                counts[i] += lost, ratio * used > 1.0, lost or ratio * used > 1.0
    rows = [
        (name, *map(str, counts[i]), f'{predicted[i]:.1f}')
        for i, name in enumerate(('nominal robot', 'uncertain robot'))
    ]
    header = ('grasps planned for the', 'lost', 'wrinkled', 'failed', 'predicted')
    return Table(f'{robots} drawn robots in MuJoCo', header, rows)


def tables() -> Iterator[Table]:
    """Yield the tables."""
    for name in ('disc', 'box', 'hexagon'):
        yield _calibration(name)
    yield _best()
    yield _times()
    yield _carried()
