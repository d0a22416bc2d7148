# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Closing in place: members press on a free object, which stays where it is.

Two members face it so that friction holds it as soon as both press. From there on it is held and
the contacts roll: the squeeze rises while the twist of the object is zero. The path is what the
rollers do then, by the mechanics of the elastic plant. A path for an object that the ground holds
would drag a free one along, by several centimetres.
"""

from __future__ import annotations

from collections.abc import Iterator
import math

from isotruss_ros.core.contact.analyze_grasp import analyze_grasp
from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.held_grip import HeldGrip, HoldStatus
from isotruss_ros.core.holding.loaded_frame import held_utilisation
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.pose import pose_difference
from isotruss_ros.core.planning.closed_grip import ClosedGrip, exceeded_bound, grasp_loads
from isotruss_ros.core.planning.closing import Closing, outward_normals
from isotruss_ros.core.planning.closing_step import press
from isotruss_ros.core.planning.facing import contact_ends
from isotruss_ros.core.planning.grasp_plan import SearchTally
from isotruss_ros.core.planning.motion_in_place import squeeze_in_place, SQUEEZE_TOLERANCE
from isotruss_ros.core.planning.requirements import GraspRequirements
import numpy as np

#: An object that is nearer than this to where it lay has stayed there [m].
SAME_PLACE = 1e-4
#: So often the depths of three members are corrected until the object stays there.
MAX_BALANCE_STEPS = 4


def close_in_place(
    touch: Configuration, closing: Closing, needs: GraspRequirements, tally: SearchTally
) -> Iterator[ClosedGrip]:
    """
    Yield grips that press harder and harder, until a bound is reached.

    :param touch: configuration in which the members touch the object.
    :param closing: what closes.
    :param needs: what the grasp must fulfil.
    :param tally: of the search.
    :raises SolverError: a quadratic program, or the contact, was not solved.
    :raises StructureError: see `structure_of`.
    """
    settings, wanted = closing.settings, needs.squeeze
    grasp, pair = _hold(touch, closing, tally), len(closing.members) == 2
    if grasp is None or not _sticks(grasp, needs.friction, tally):
        return
    # Two members bring the object back to its place with the next step only.
    if not pair and (first := _judge(grasp, closing, needs, tally)) is not None:
        yield first
    share = 1.0
    while share > settings.least_share and not (wanted and _reached(grasp, wanted)):
        rise = min(
            (settings.squeeze_growth - 1.0) * grasp.squeeze,
            settings.squeeze_rise,
        )
        if pair:
            step = settings.closing_step * touch.robot.description.tube_diameter
            rise = -step * grasp.squeeze_stiffness()
        force = min(grasp.squeeze + share * rise, wanted or math.inf)
        moved = squeeze_in_place(grasp, force, closing, tally)
        found = None if moved is None else _judge(moved, closing, needs, tally)
        if found is None:
            share *= settings.refinement
            continue
        grasp = moved
        yield found


def _judge(
    grasp: HeldGrip, closing: Closing, needs: GraspRequirements, tally: SearchTally
) -> ClosedGrip | None:
    """Return a grip with what it does; None where a contact slips or a bound is exceeded."""
    if not _sticks(grasp, needs.friction, tally):
        return None
    tally.analyses += 1
    body = _placed(grasp, closing.body)
    analysis = analyze_grasp(grasp.config, body, needs.friction, needs.external_wrench)
    loads = grasp_loads(analysis, grasp.normal_forces.tolist(), held_utilisation(grasp))
    over = exceeded_bound(needs, loads)
    if over is not None:
        tally.record(*over, 1.0 - over[2] / over[1])
        return None
    wanted = needs.squeeze is None or _reached(grasp, needs.squeeze)
    margin = _require(grasp, closing, analysis, needs, tally) if wanted else None
    return ClosedGrip(grasp.config, body, analysis, loads, grasp.squeeze, margin)


def _hold(touch: Configuration, closing: Closing, tally: SearchTally) -> HeldGrip | None:
    """Return how the object is held first; three members press as deep as keeps it there."""
    body, members = closing.body, np.array(closing.members)
    settings, tube = closing.settings, touch.robot.description.tube_diameter
    one, other = contact_ends(body, outward_normals(touch, closing))
    depth = settings.first_contact if (one == other).all() else settings.face_contact
    config, depths = touch, np.full(len(members), depth * tube)
    for _ in range(MAX_BALANCE_STEPS):
        pressed = press(config, closing, depths, tally)
        if pressed is None:
            return None
        config, found = pressed, attach_grip(pressed, body, members)
        if isinstance(found, HoldStatus):
            tally.record('held', 0.0, 1.0, 30.0)
            return None
        away = found.body.center - body.center
        if len(members) == 2 or abs(away) < SAME_PLACE:
            break
        normals = outward_normals(config, closing)
        depths = np.maximum(depths + (away * normals.conj()).real, 0.0)
    return roll_grip(found, config)  # from here on contacts roll


def _sticks(grasp: HeldGrip, friction: float, tally: SearchTally) -> bool:
    """Return whether the contacts stick."""
    hold = grasp.hold(friction)
    if hold is HoldStatus.SLIPS:
        needed = grasp.required_friction
        tally.record('force_closure', needed, friction, 1.0 - friction / needed)
    elif hold is not HoldStatus.HELD:
        tally.record('held', 0.0, 1.0, 10.0)
    return hold is HoldStatus.HELD


def _require(
    grasp: HeldGrip,
    closing: Closing,
    analysis: GraspAnalysis,
    needs: GraspRequirements,
    tally: SearchTally,
) -> float | None:
    """Return the slip margin of a grip [N], None if it does not bear what it must."""
    loaded = grasp
    if any(needs.external_wrench):
        loaded = roll_grip(grasp, grasp.config, np.array(needs.external_wrench))
    if loaded is None:
        tally.record('held', 0.0, 1.0, 2.0)
        return None
    if not _sticks(loaded, needs.friction, tally):
        return None
    names, count = grasp.config.robot.member_names, len(closing.members)
    if set(analysis.contact_forces) != {names[i] for i in closing.members}:
        # Friction deflects a soft structure by so much that without it one member lets go.
        tally.record('grip', len(analysis.contact_forces), count, 15.0)
        return None
    slip, fast = loaded.slip_margin(needs.friction), analysis.closure_margin
    for name, value, least in (
        ('min_slip_margin', slip, needs.min_slip_margin),
        ('min_margin', fast, needs.min_margin),
    ):
        if least is not None and value < least:
            tally.record(name, value, least, 1.0 - max(0.0, value) / least if least else 1.0)
            return None
    return slip


def _placed(grasp: HeldGrip, lay: ConvexObject) -> ConvexObject:
    """Return the object where it is: where it lay, if it stayed there."""
    moved = pose_difference(grasp.pose, lay.pose) * (1.0, 1.0, lay.arm)
    return lay if np.abs(moved).max() < SAME_PLACE else lay.moved_to(grasp.pose)


def _reached(grasp: HeldGrip, squeeze: float) -> bool:
    return grasp.squeeze >= (1.0 - 2.0 * SQUEEZE_TOLERANCE) * squeeze
