# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Correction of planned grasps, so that squeeze and slip margin in MuJoCo are as planned."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from isotruss_ros.core import grasp_gradient, settle_grasp
from isotruss_ros.core.holding.contact_forces import slip_conditions
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.planning.grasp_plan import PlannedGrasp
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np

#: Relative tolerance of squeeze and slip margin [-], and largest number of measurements [-].
TOLERANCE, ROUNDS = 0.02, 10
#: Pose of the object outside of the robot while the rollers move: x, y [m] and angle [rad].
PARKING_POSE = (5.0, 5.0, 0.0)
#: Duration of a motion of the rollers, and of the wait until the robot is at rest [s].
MOTION_TIME, REST_TIME = 2.0, 2.0
#: Size of the measuring forces relative to the planned slip margin [-], and their duration [s].
PULL_RATIO, PULL_TIME = 0.1, 0.5
#: Largest correction of a roller in an iteration [m].
MAX_CORRECTION = 0.03


class RefinedGrasp(NamedTuple):
    """Grasp that was corrected by measurements in a MuJoCo plant."""

    #: planned grasp with corrected roller positions after the first contact; everything else is
    #: unchanged
    grasp: PlannedGrasp
    measured: Array  #: (n, 2) squeeze and slip margin in each iteration [N]
    agrees: bool  #: whether the last measurement is within tolerance


def refine_grasp(grasp: PlannedGrasp, plant: MujocoPlant) -> RefinedGrasp:
    """
    Correct a planned grasp until squeeze and slip margin in the plant are as planned.

    In each iteration the object is fixed at its planned pose until the tubes rest on it without
    friction; then it is released with friction. The rollers are corrected with the gradients of
    squeeze and slip margin at the equilibrium of the released object.

    :param grasp: planned grasp with two grasping members.
    :param plant: plant with the same robot and object, without other objects and external loads.
    :raises PlantError: the simulation became unstable.
    :raises GraspError: the model has no equilibrium near the object's pose in the plant.
    """
    planned, found = np.array([grasp.squeeze, grasp.slip_margin]), []
    config, grip, step = grasp.config, grasp.grip, None
    while True:
        _press(plant, grasp, config.roller_positions)
        found.append(_measure(plant, grasp))
        off = found[-1] / planned - 1.0
        agrees = bool((np.abs(off) <= TOLERANCE).all())
        if agrees or len(found) == ROUNDS:
            break
        if step is None:
            resting = grip.body.moved_to(plant.object_pose())
            settled = settle_grasp(config, resting, grip.friction, members=grip.members)
            gradient = grasp_gradient(settled)
            slopes = np.stack([gradient.squeeze, gradient.slip_margin])
            slopes = slopes[:, gradient.parameters.rollers] / planned[:, None]
        else:
            # Broyden's update by the result of the last step.
            change = (found[-1] - found[-2]) / planned - slopes @ step
            slopes = slopes + np.outer(change, step) / (step @ step)
        step = np.linalg.lstsq(slopes, -off, rcond=None)[0]
        step /= max(1.0, float(np.abs(step).max()) / MAX_CORRECTION)
        config = config.moved_to(config.roller_positions + step)
    path, touch = grasp.path.copy(), grasp.touch
    shares = np.linspace(0.0, 1.0, len(path) - touch)
    path[touch:] += np.outer(shares, config.roller_positions - path[-1])
    path[-1] = config.roller_positions
    return RefinedGrasp(replace(grasp, config=config, path=path), np.array(found), agrees)


def _press(plant: MujocoPlant, grasp: PlannedGrasp, travel: Array) -> None:
    """Let the tubes rest on the object, fixed at its planned pose, and release the object."""
    plant.set_friction(0.0)
    plant.hold_object(PARKING_POSE)
    plant.advance(MOTION_TIME, (travel - plant.travel) / MOTION_TIME)
    plant.hold_object(grasp.grip.body.pose)
    plant.settle(REST_TIME)
    plant.set_friction(grasp.grip.friction)
    plant.release_object()
    plant.settle(REST_TIME)


def _measure(plant: MujocoPlant, grasp: PlannedGrasp) -> Array:
    """Return squeeze and slip margin (2,), measured by small wrenches on the object [N]."""
    arm, state, pull = grasp.grip.body.arm, plant.save(), PULL_RATIO * grasp.slip_margin
    forces, changes = _forces(plant, grasp), []
    for wrench in pull * np.diag([1.0, 1.0, arm]):
        ends = []
        for sign in (1.0, -1.0):
            plant.restore(state)
            plant.pull(sign * wrench)
            plant.settle(PULL_TIME)
            ends.append(_forces(plant, grasp))
        changes.append((ends[0] - ends[1]) / (2.0 * pull))
    plant.restore(state)
    members = np.arange(len(grasp.grip.members))
    rows = slip_conditions(members, grasp.grip.friction)
    sizes = np.linalg.norm(rows @ np.array(changes).T, axis=1)
    return np.array([forces[members].mean(), (rows @ forces / sizes).min()])


def _forces(plant: MujocoPlant, grasp: PlannedGrasp) -> Array:
    """Return the normal and friction forces (2m,) of the members [N]."""
    by_member = plant.contact_forces()
    forces = [by_member[name] for name in grasp.grip.members]
    return np.array([each.normal for each in forces] + [each.friction for each in forces])
