# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Evaluation of one grasp candidate by approach and closing."""

from __future__ import annotations

import math

from isotruss_ros.core.chance.probability import find_chance
from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.planning.approach import approach, Closing, press
from isotruss_ros.core.planning.foresee_path import foresee_grip
from isotruss_ros.core.planning.grasp_plan import ClosedGrip, PlannedGrasp
from isotruss_ros.core.planning.motion_in_place import close_in_place
from isotruss_ros.core.planning.requirements import GraspRequirements
from isotruss_ros.core.planning.violations import RequirementError, SearchTally, Violation
from isotruss_ros.core.safety.margins import shape_margins
import numpy as np

#: Grasp of a candidate, None if it violates a requirement, and tally of the candidate.
Judgement = tuple[PlannedGrasp | None, SearchTally]


@single_threaded  # also in the processes of an executor
def judge_candidate(config: Configuration, closing: Closing) -> Judgement:
    """Return the grasp of a candidate, if it is admissible, and its tally."""
    grasp, tally = None, closing.tally
    try:
        with tally.recording():
            opened = list(approach(config, closing))
            closed = close_grip(opened[-1], closing)
            if closed is not None:
                pressed, grip = closed
                if closing.needs.carry:
                    tally.closest = None  # the violation that ended the closing is no reason
                    grip = _check_carry(grip, closing)
                grasp = _describe_grasp(closing.needs, [*opened, *pressed], len(opened), grip)
    except IsotrussError as error:
        # A candidate without a solution is rejected; its tally is kept.
        tally.record(Violation(str(error), 0.0, 0.0))
    return grasp, tally


def close_grip(
    opened: Configuration, closing: Closing
) -> tuple[list[Configuration], ClosedGrip] | None:
    """
    Return the path from first contact to the best admissible grip, and this grip; or None.

    The squeeze is increased until the score decreases or a requirement is violated.
    """
    best, best_score = None, -math.inf
    with closing.tally.recording():
        path = [press(opened, closing, np.zeros(len(closing.members)))]
        for grip in close_in_place(path[0], closing):
            path.append(grip.equilibrium.config)
            if grip.slip_margin is None:
                continue
            # A smaller squeeze means a shorter path.
            score = closing.needs.rate_grip(grip, -grip.equilibrium.squeeze)
            if score <= best_score:
                break
            best, best_score = (path[:], grip), score
    return best


def _check_carry(grip: ClosedGrip, closing: Closing) -> ClosedGrip:
    """Return the grip with its chance on `carry`; raise RequirementError if it ends early."""
    held, needs = grip.equilibrium, closing.needs
    carry, obstacles = np.array(needs.carry), needs.obstacles
    foresight = foresee_grip(held.config, held.body, needs.friction, carry, obstacles=obstacles)
    if foresight is None or foresight.why:
        raise RequirementError('carry', foresight.share if foresight else 0.0, 1.0)
    if closing.uncertainty is None:
        return grip
    covariance = closing.uncertainty.covariance(held)
    friction = closing.uncertainty.mean_friction(needs.friction)
    return grip._replace(chance=find_chance(foresight.grips, friction, covariance))


def _describe_grasp(
    needs: GraspRequirements, configs: list[Configuration], touch: int, grip: ClosedGrip
) -> PlannedGrasp:
    """Return the planned grasp, with the index of the first configuration in contact."""
    held = grip.equilibrium
    path = np.array([config.roller_positions for config in configs])
    travel = float(np.abs(np.diff(path, axis=0)).sum(axis=0).max())
    return PlannedGrasp(
        grip=Grip(held.member_names, held.body, needs.friction),
        members=held.member_names,
        config=held.config,
        equilibrium=held,
        score=needs.rate_grip(grip, -travel),
        squeeze=held.squeeze,
        slip_margin=grip.slip_margin,
        required_friction=held.required_friction,
        max_contact_force=float(held.normal_forces.max()),
        total_force=float(held.normal_forces.sum()),
        utilisation=float(held.sections.used.max()),
        travel=travel,
        rigidity=min(shape_margins(config).rigidity for config in configs),
        path=path,
        touch=touch,
        chance=grip.chance,
    )
