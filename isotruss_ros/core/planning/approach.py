# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Kinematic approach of the grasping members to an object; each step is a quadratic program (QP).

minimize 1/2 |g + (dg/dphi) u - target|^2 + 1/2 a^2 |turn - facing|^2 + 1/2 w |u - n|^2 subject to
limits, bounds on gaps of other parts and of obstacles, rigidity and clearance,
|u| <= longest step

u is the roller travel of the step, n is the travel to the nominal posture, g are the gaps of the
grasping members, turn is their rotation in the step, facing is their rotation to the directions
`Closing.facing`, a is `TURNING_ARM`, and w is `MOTION_WEIGHT`. The configuration at the end of
each step is evaluated; a step that violates a requirement is halved. So the steps form an
admissible path. Lengths are relative to the mean member length at home or to the tube diameter, so
that they suit robots of any size.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
import functools
from typing import NamedTuple

from isotruss_ros.core.chance.uncertainty import Uncertainty
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.holding.contacts import facing_lines
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.kinematics.rigidity import Modes, rigidity_index
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.grip_rows import member_rows
from isotruss_ros.core.manipulation.limits import Limit
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.obstacle import Obstacle
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.qp import QuadraticProgram, require_solution, solve_qp
from isotruss_ros.core.numerics.tolerances import COINCIDENCE, MAX_SEARCH_STEPS, ROUNDING
from isotruss_ros.core.planning.facing import balances, CONE_SHARE
from isotruss_ros.core.planning.requirements import GraspRequirements
from isotruss_ros.core.planning.violations import RequirementError, SearchTally
from isotruss_ros.core.safety.barrier_law import ActiveValues, BarrierLaw
from isotruss_ros.core.safety.barriers import bent_parts
from isotruss_ros.core.safety.obstacle_barrier import ObstacleBarrier
import numpy as np

#: Largest roller travel and gap change of a step, in mean member lengths [-].
MAX_STEP, MAX_GAP_STEP = 0.035, 0.027
#: Largest rotation of a member in a step [rad].
MAX_TURN_STEP = 0.1
#: Weight of the rollers' motion relative to the gaps [-].
MOTION_WEIGHT = 1e-4
#: Length that scales rotations against gaps [m].
TURNING_ARM = 0.3
#: Smallest distance between parts of the robot, and between the object and the parts that do not
#: grasp it, in tube diameters [-].
CLEARANCE = 0.1
#: Pairs of parts of the robot are constrained in a step if their distance is smaller than this, in
#: mean member lengths [-].
MAX_CONSTRAINED_DISTANCE = 0.15
#: Tolerance of the gaps of the grasping members in tube diameters [-], at the end of the approach
#: and for an overshoot; also the gap to which a grip is opened before a retreat. A rotation of
#: 1 rad counts as one tube diameter.
GAP_TOLERANCE = 0.015
#: Gap between the grasping members and the object at the end of the approach, in tube diameters
#: [-].
STANDOFF = 0.06
#: Largest step of a quantity toward its bound, relative to the distance from the bound [-].
BOUND_SHARE = 0.5
#: Depth of the object in each grasping member at first contact, in tube diameters [-].
FIRST_INDENTATION = 1e-3


@dataclass(frozen=True, eq=False)
class Closing:
    """Object, grasping members, bounds and targets of a closing motion."""

    body: ConvexObject  #: the object, which does not move
    members: Indices  #: (s,) indices of the grasping members
    limit: Limit  #: limit on a step, which is regarded as a motion of 1 s
    needs: GraspRequirements  #: requirements of the path and of the grasp
    friction_angle: float = 0.0  #: half angle of the friction cones that may be used [rad]
    #: (r,) roller positions toward which rollers move if the closing leaves them free [m]; None:
    #: no such positions
    nominal_posture: Array | None = None
    #: (s,) desired unit vectors from the object to the members, x + iy; None: no desired rotation,
    #: after the approach
    facing: Points | None = None
    uncertainty: Uncertainty | None = None  #: grasps are ranked by the chance; None: by measure
    #: counts of the search, and the violation of the candidate closest to an admissible grasp
    tally: SearchTally = field(default_factory=SearchTally)

    def normals(self, config: Configuration) -> Points:
        """Return unit vectors from the object to the grasping members, (s,) x + iy."""
        return facing_lines(config, self.body, self.members)[1]


class SearchState(NamedTuple):
    """Configuration with all quantities that are bounded while the members close on the object."""

    config: Configuration  #: the configuration
    #: (3m,) gaps between the object and the members, modules and rods [m]; negative in an overlap
    gaps: Array
    gaps_by_nodes: Array  #: (3m, 2n) derivatives of the gaps with respect to node coordinates [-]
    modes: Modes  #: smallest singular values, see `Modes`; the first is the rigidity index
    distances: Array  #: (p,) distances of the pairs of `CollisionModel` [m]
    near: ActiveValues  #: distances of near parts from obstacles [m]
    barrier: ObstacleBarrier  #: barrier on these distances

    @property
    def obstacle_gap(self) -> float:
        """Return the smallest distance from an obstacle [m]; infinite without a near one."""
        return float(self.near.values.min(initial=np.inf))

    def check_bounds(
        self, min_rigidity: float, min_clearance: float, min_gaps: Array, min_obstacle_gap: float
    ) -> None:
        """Raise RequirementError if rigidity, clearance [m] or a gap (3m,) [m] is too small."""
        worst = int((self.gaps - min_gaps).argmin())
        for requirement, value, bound in (
            ('rigidity', self.modes.values[0], min_rigidity),
            ('self_clearance', self.distances.min(initial=np.inf), min_clearance),
            ('object_clearance', self.gaps[worst], min_gaps[worst]),
        ):
            if value < bound:
                raise RequirementError(requirement, float(value), float(bound))
        self.check_obstacles(min_obstacle_gap)

    def check_obstacles(self, min_gap: float) -> None:
        """Raise RequirementError if a part of the robot is too near to an obstacle [m]."""
        if self.obstacle_gap < min_gap:
            nearest = self.near.indices[[self.near.values.argmin()]]
            (name,) = self.barrier.names(nearest)
            raise RequirementError('obstacle_clearance', self.obstacle_gap, min_gap, name)


def evaluate_state(
    config: Configuration, body: ConvexObject, needs: GraspRequirements, grip: Grip | None = None
) -> SearchState:
    """
    Return the gaps, distances and singular values of a configuration around an object.

    They are those of straight tubes, or of the bent ones of a grip in equilibrium.
    """
    model, modes = collision_model(config.robot), rigidity_index(config.robot).modes(config)
    bent = bent_parts(grip)
    gaps, by_nodes, _ = model.body_distances(config, body, bent=bent)
    barrier = obstacle_barrier(config.robot, needs.obstacles, needs.min_obstacle_clearance)
    near, distances = barrier.active(config, grip), model.distances(config, bent=bent)
    return SearchState(config, gaps, by_nodes, modes, distances, near, barrier)


@functools.lru_cache(maxsize=16)
def obstacle_barrier(
    robot: Robot, obstacles: tuple[Obstacle, ...], clearance: float
) -> ObstacleBarrier:
    """Return the barrier that keeps the robot at a clearance from obstacles [m], cached."""
    band = MAX_CONSTRAINED_DISTANCE * float(robot.home.member_lengths.mean())
    return ObstacleBarrier(robot, BarrierLaw(clearance, band), obstacles, needs_object=False)


def approach(config: Configuration, closing: Closing) -> Iterator[Configuration]:
    """
    Yield the configurations of the path on which grasping members approach the object.

    At the end of the path the directions of the members admit force closure.
    """
    diameter, members = config.robot.description.tube_diameter, closing.members
    targets = np.full(len(members), STANDOFF * diameter)
    state = evaluate_state(config, closing.body, closing.needs)
    usable_angle = CONE_SHARE * closing.friction_angle
    least_error, idle_steps, step_share = np.inf, 0, 1.0
    while True:
        yield state.config
        # Distance from the end: by the gaps, and by rotations until force closure is possible.
        gap_error = float((state.gaps[members] - targets).max())
        normals = closing.normals(state.config)
        has_closure = balances(closing.body, normals, usable_angle, 0.5 * diameter)
        rotation = 0.0 if has_closure else float(np.abs(np.angle(closing.facing / normals)).sum())
        error = max(gap_error, 0.0) / diameter + rotation
        if error <= GAP_TOLERANCE:
            return
        # Successive steps with less progress than the tolerance.
        idle_steps = 0 if error < least_error - GAP_TOLERANCE else idle_steps + 1
        least_error = min(least_error, error)
        if idle_steps > MAX_SEARCH_STEPS:
            if gap_error > GAP_TOLERANCE * diameter:
                raise RequirementError('reach', gap_error, 0.0)
            raise RequirementError('facing', rotation, 0.0)
        step_goal = replace(closing, facing=None) if has_closure else closing
        state, step_share = _take_step(state, step_goal, targets, step_share)


def press(config: Configuration, closing: Closing, depths: Array) -> Configuration:
    """Return the configuration with given depths (s,) of the members in the object [m]."""
    # A nominal posture would shift the gaps from their targets.
    closing = replace(closing, nominal_posture=None, facing=None)
    state = evaluate_state(config, closing.body, closing.needs)
    step_share, error = 1.0, np.inf
    for _ in range(15):
        error = float(np.abs(state.gaps[closing.members] + depths).max())
        if error <= ROUNDING:
            return state.config
        state, step_share = _take_step(state, closing, -depths, step_share)  # depth = -gap
    raise RequirementError('reach', error, 0.0)


def _take_step(
    state: SearchState, closing: Closing, targets: Array, step_share: float
) -> tuple[SearchState, float]:
    """
    Return the state after a step of the members' gaps to their targets (s,) [m].

    Also return the next share of the longest step: doubled, or reduced until it is admissible.
    """
    config, diameter = state.config, state.config.robot.description.tube_diameter
    travel = _solve_step(state, closing, targets, step_share)
    # Bounds after the step. Gaps may become smaller than the program allows, because it is exact
    # only to first order. Quantities beyond their bounds must not become worse.
    min_rigidity = min(closing.needs.min_rigidity, state.modes.values[0])
    min_clearance = state.distances.min(initial=0.0)
    min_gaps = np.full(len(state.gaps), BOUND_SHARE * CLEARANCE * diameter)
    min_gaps[closing.members] = targets - GAP_TOLERANCE * diameter
    min_gaps = np.minimum(min_gaps, state.gaps - COINCIDENCE)
    min_obstacle_gap = min(closing.needs.min_obstacle_clearance, state.obstacle_gap - COINCIDENCE)
    for factor in (1.0, 0.5, 0.25, 0.125, 0.0625):
        closing.tally.evaluations += 1
        try:
            moved = config.moved_to(config.roller_positions + factor * travel)
            moved_state = evaluate_state(moved, closing.body, closing.needs)
            moved_state.check_bounds(min_rigidity, min_clearance, min_gaps, min_obstacle_gap)
            return moved_state, min(1.0, step_share * (factor if factor < 1.0 else 2.0))
        except ConfigurationError:
            violation = RequirementError('rigidity', 0.0, min_rigidity)
        except RequirementError as error:
            violation = error
    raise violation


def _solve_step(state: SearchState, closing: Closing, targets: Array, step_share: float) -> Array:
    """Return the roller travel (r,) [m] of one step, from the program at the top of the module."""
    config, members = state.config, closing.members
    length = step_share * config.robot.home.member_lengths.mean()
    bound_rows, lower = _bound_rows(state, closing, targets)
    # Desired changes of the members' gaps, and of their directions times an arm.
    rates = bound_rows[members]  # the first rows have the gaps of all parts
    changes = np.maximum(targets - state.gaps[members], -MAX_GAP_STEP * length)
    if closing.facing is not None:
        rotations = np.angle(closing.facing * closing.normals(config).conj())
        rotations = np.clip(rotations, -MAX_TURN_STEP, MAX_TURN_STEP)
        names = tuple(config.robot.member_names[member] for member in members)
        rotation_rates = member_rows(config, names)[:, 2]  # after vx and vy
        rates = np.vstack([rates, TURNING_ARM * rotation_rates])
        changes = np.append(changes, TURNING_ARM * rotations)
    # Longest travel, and the travel to the nominal posture.
    longest = np.full(len(config.roller_positions), MAX_STEP * length)
    nominal = np.zeros(len(longest))
    if closing.nominal_posture is not None:
        nominal = np.clip(closing.nominal_posture - config.roller_positions, -longest, longest)
    # The travel u minimises 1/2 |rates u - changes|^2 + MOTION_WEIGHT / 2 |u - nominal|^2.
    unit = np.eye(len(longest))
    hessian = rates.T @ rates + MOTION_WEIGHT * unit
    gradient = -rates.T @ changes - MOTION_WEIGHT * nominal
    rows, upper = np.vstack([-bound_rows, unit, -unit]), np.concatenate([-lower, longest, longest])
    return require_solution(solve_qp(QuadraticProgram(hessian, gradient, rows, upper)))


def _bound_rows(state: SearchState, closing: Closing, targets: Array) -> tuple[Array, Array]:
    """
    Return the matrix (k, r) and the bounds (k,) of the constraints matrix @ travel >= bounds.

    The first bound the gaps of all parts to the object, by targets for grasping members.
    """
    config, robot = state.config, state.config.robot
    collisions, length = collision_model(robot), robot.home.member_lengths.mean()
    clearance = CLEARANCE * robot.description.tube_diameter
    # Lower bounds of the changes by one step: gaps, rigidity, and clearances of near pairs. Two
    # singular values are bounded, because they may exchange their order during a step.
    gap_bounds = BOUND_SHARE * (clearance - state.gaps)
    gap_bounds[closing.members] = targets - state.gaps[closing.members]
    modes = Modes(*(values[..., :2] for values in state.modes))
    rigidity_bounds = BOUND_SHARE * (closing.needs.min_rigidity - modes.values)
    rigidity_rows = rigidity_index(robot).gradients(config, modes)
    pairs = np.flatnonzero(state.distances < MAX_CONSTRAINED_DISTANCE * length)
    pair_bounds = BOUND_SHARE * (clearance - state.distances[pairs])
    pair_rows = collisions.gradients(config, pairs)
    obstacle_bounds = BOUND_SHARE * (closing.needs.min_obstacle_clearance - state.near.values)
    every_row = [state.gaps_by_nodes, rigidity_rows, pair_rows]
    every_bound = [gap_bounds, rigidity_bounds, pair_bounds]
    if len(obstacle_bounds):
        every_row.append(state.near.node_rows)
        every_bound.append(obstacle_bounds)
    rows = config.roller_rows(np.vstack(every_row))
    # A quantity beyond its bound must not decrease.
    bounds = np.minimum(0.0, np.concatenate(every_bound))
    limit_rows, upper = closing.limit.rows(config).one_sided()
    return np.vstack([rows, -limit_rows]), np.concatenate([bounds, -upper])
