# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Closing in place: the squeeze on a free object is increased without moving the object.

Two members have force closure from the first contact on. Then the rollers move such that the
squeeze increases while the object keeps its pose; the motion is computed with rolling contacts and
elastic tubes. A motion computed for a fixed object would displace a free object by several
centimetres.
"""

from __future__ import annotations

from collections.abc import Iterator
import math

from isotruss_ros.core.chance.probability import Chance, find_chance
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.held_grip import HeldGrip, HoldStatus
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.planning.approach import press
from isotruss_ros.core.planning.closing import Closing, FIRST_INDENTATION
from isotruss_ros.core.planning.facing import CONE_SHARE
from isotruss_ros.core.planning.grasp_plan import ClosedGrip
from isotruss_ros.core.planning.motion_in_place import (
    hold_between,
    squeeze_in_place,
    SQUEEZE_TOLERANCE,
)
from isotruss_ros.core.planning.requirements import GraspRequirements
from isotruss_ros.core.planning.violations import RequirementError
import numpy as np

#: Decrease of the distance between the members from waypoint to waypoint, in tube diameters [-].
CLOSING_STEP = 0.12
#: Factor by which the increments are reduced after the first violation of a bound [-]; the second
#: violation ends the closing.
REFINEMENT = 0.34


def close_in_place(
    touch: Configuration, closing: Closing, needs: GraspRequirements
) -> Iterator[ClosedGrip]:
    """Yield grips with increasing squeeze until a requirement would be violated."""
    wanted = needs.squeeze
    diameter = touch.robot.description.tube_diameter
    depths = np.full(len(closing.members), FIRST_INDENTATION * diameter)
    grasp = hold_between(press(touch, closing, depths), closing)
    _check_hold(grasp, _usable_friction(needs.friction))
    # A grip of two members is assessed after the first step, which moves the object to its pose.
    if len(closing.members) > 2:
        with closing.tally.recording():
            yield _judge(grasp, closing, needs)
    share = 1.0
    while share >= REFINEMENT and not (wanted and _reached(grasp, wanted)):
        rise = -CLOSING_STEP * diameter * grasp.squeeze_stiffness()
        force = min(grasp.squeeze + share * rise, wanted or math.inf)
        with closing.tally.recording():
            moved = squeeze_in_place(grasp, force, closing)
            yield _judge(moved, closing, needs)
            grasp = moved
            continue
        share *= REFINEMENT


def _judge(grasp: HeldGrip, closing: Closing, needs: GraspRequirements) -> ClosedGrip:
    """Return a grip with its contact forces; raise RequirementError for slip or a violation."""
    _check_hold(grasp, _usable_friction(needs.friction))
    closing.tally.analyses += 1
    forces = grasp.normal_forces
    needs.check_bounds(
        max_contact_force=forces.max(),
        max_total_force=forces.sum(),
        max_utilisation=grasp.sections.used.max(),
    )
    margin = chance = None
    if needs.squeeze is None or _reached(grasp, needs.squeeze):
        with closing.tally.recording():
            margin, chance = _find_margin(grasp, closing, needs)
    return ClosedGrip(grasp, margin, chance)


def _usable_friction(friction: float) -> float:
    """Return the part of the friction that a grip may use while it closes on its path."""
    return math.tan(CONE_SHARE * math.atan(friction))


def _check_hold(grasp: HeldGrip, friction: float) -> None:
    """Raise RequirementError if a contact slips."""
    hold = grasp.hold(friction)
    if hold is HoldStatus.SLIPS:
        raise RequirementError('force_closure', grasp.required_friction, friction)
    if hold is not HoldStatus.HELD:
        raise RequirementError('held', 0.0, 1.0)


def _find_margin(
    grasp: HeldGrip, closing: Closing, needs: GraspRequirements
) -> tuple[float, Chance | None]:
    """Return the slip margin under the required wrench [N], and the chance of being held."""
    loaded: HeldGrip | None = grasp
    if any(needs.external_wrench):
        loaded = roll_grip(grasp, grasp.config, np.array(needs.external_wrench))
    if loaded is None:
        raise RequirementError('held', 0.0, 1.0)
    _check_hold(loaded, needs.friction)
    slip = loaded.slip_margin(needs.friction)
    needs.check_bounds(min_slip_margin=slip)
    if closing.uncertainty is None:
        return slip, None
    try:
        body = grasp.body.moved_to(grasp.pose)
        rest = attach_grip(grasp.config, body, grasp.members)
        grips = [rest] if loaded is grasp else [rest, loaded]
        covariance = closing.uncertainty.covariance(loaded)
        return slip, find_chance(grips, needs.friction, covariance)
    except GraspError:
        raise RequirementError('held', 0.0, 1.0) from None


def _reached(grasp: HeldGrip, squeeze: float) -> bool:
    return grasp.squeeze >= (1.0 - 2.0 * SQUEEZE_TOLERANCE) * squeeze
