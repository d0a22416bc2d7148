# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Motion of a held object that rolls on the tubes of the moving robot.

Ends of faces lose and gain contact, and a third member may come into contact.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from isotruss_ros.core.holding.build_statics import (
    build_statics,
    facing_lines,
    find_dents,
    find_pressed,
    start_at,
)
from isotruss_ros.core.holding.contact_forces import PressedContacts
from isotruss_ros.core.holding.contact_statics import (
    ContactConditions,
    ContactStatics,
    FRICTION_COMPLIANCE,
    unwrapped,
)
from isotruss_ros.core.holding.face_ends import (
    displacement_at,
    far_end_depth,
    is_short,
    open_faces,
    with_far_end,
)
from isotruss_ros.core.holding.held_grip import (
    HeldGrip,
    MAX_DISPLACEMENT,
    scaled_wrench,
    travel_rates,
)
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.depths import member_depths, member_lines
from isotruss_ros.core.manipulation.grip import GRIP_SIZES
from isotruss_ros.core.model.convex_object import segment_gaps
from isotruss_ros.core.model.shapes import Face
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.tolerances import MAX_SEARCH_STEPS
from isotruss_ros.core.statics.bent_tubes import FOLLOWED_MOTION
from isotruss_ros.core.statics.section import Pressure
from isotruss_ros.core.statics.structure import structure_of
import numpy as np

#: No contacts.
NO_CONTACTS = np.zeros(0, dtype=np.intp)
NO_CONTACTS.flags.writeable = False


def roll_grip(
    grip: HeldGrip, config: Configuration, external_wrench: Array | None = None
) -> HeldGrip | None:
    """
    Return a grip in another configuration after its contacts have rolled without slip.

    The end of a face loses contact if it is in tension, and gains contact if it would penetrate
    the member. A third member is part of the grip while it is in compression.

    :param grip: equilibrium of the object.
    :param config: configuration close to the configuration of the grip.
    :param external_wrench: (fx, fy, m) on the object about its frame's origin [N, N m]; None:
        zero.
    :return: the grip in the given configuration; None if no equilibrium exists.
    """
    wrench = scaled_wrench(external_wrench, grip.arm)
    rolled = roll_contacts(grip, config, grip.contacts, grip.anchors, grip.angles, wrench)
    changes = iter(range(MAX_SEARCH_STEPS))
    found = None if rolled is None else _lift_ends(rolled, changes)
    return None if found is None else _join(_lay_down(found, changes))


def roll_contacts(
    grip: HeldGrip,
    config: Configuration,
    contacts: PressedContacts,
    anchors: Array,
    angles: Array,
    wrench: Array,
    fresh: Indices = NO_CONTACTS,
) -> HeldGrip | None:
    """
    Return the equilibrium in another configuration, with given contacts that roll without slip.

    :param grip: previous equilibrium.
    :param config: configuration close to the configuration of the grip.
    :param contacts: the k contacts.
    :param anchors: (k,) rolling invariants, see `ContactStatics.anchors` [m].
    :param angles: (k,) angles of the normals in the object's frame, not wrapped to one turn [rad].
    :param wrench: external wrench (fx, fy, m / arm) on the object [N]; arm is the object's
        characteristic radius.
    :param fresh: indices of new contacts, which have no friction yet.
    :return: the grip in the given configuration; None if no equilibrium exists.
    """
    moved, kept = config.roller_positions - grip.config.roller_positions, grip.state.unknowns
    same = contacts is grip.contacts
    travel = travel_rates(config, contacts.members) @ config.roller_positions
    if same:  # with the same dents
        start, structure = grip.ahead(moved), structure_of(config, grip.tubes.pressure)
        loads, feet = grip.statics.loads(start), start[grip.state.places.feet]
        bent = grip.statics.bent.update(loads, feet, structure)
        statics = replace(grip.statics, bent=bent)
    else:
        normals = grip.body.turn * np.exp(1j * angles)
        statics = build_statics(config, grip.body, contacts, grip.tubes, normals)
        start = kept = start_at(statics, grip.body)
    conditions, reach = stick(statics, anchors, travel, angles, fresh), FOLLOWED_MOTION
    settled = statics.settle(start, wrench, conditions, MAX_SEARCH_STEPS, reach)
    if settled is None and start is not kept:
        settled = statics.settle(kept, wrench, conditions, MAX_SEARCH_STEPS, reach)
    if settled is None:
        return None
    statics, state = settled
    if len(fresh):
        found = statics.anchors(state.unknowns, state.normals, travel, angles)
        anchors = anchors.copy()
        anchors[fresh] = found[fresh]
    return replace(
        grip,
        config=config,
        body=grip.body.moved_to(state.unknowns[:3]),
        anchors=anchors,
        angles=unwrapped(state.unknowns, state.normals, angles),
        statics=statics,
        state=state,
        wrench=wrench,
        motion=(moved, state.unknowns - kept) if same else None,
    )


def stick(
    statics: ContactStatics, anchors: Array, travel: Array, angles: Array, free: Indices
) -> ContactConditions:
    """
    Return the conditions of rolling without slip, which are the integral of (17) over time.

    The conditions state that the rolling invariants A_i are constant:

        kappa_i (s_i - phi_i) - arc(arg nu_i - theta) = A_i

    The symbols are explained in `ContactStatics.anchors`. For new contacts, the condition is zero
    friction.

    :param statics: equations of equilibrium.
    :param anchors: (k,) rolling invariants A_i [m].
    :param travel: (k,) length phi_i of tube that has passed the start of each contact's member
        [m].
    :param angles: (k,) previous angles of the normals in the object's frame, not wrapped to one
        turn [rad].
    :param free: indices of new contacts.
    """
    places = statics.places

    def rows(unknowns: Array, normals: Points) -> tuple[Array, Array]:
        derivative = statics.rolling_rows(unknowns, normals)
        left = statics.anchors(unknowns, normals, travel, angles) - anchors
        if len(free):
            left[free] = FRICTION_COMPLIANCE * unknowns[places.friction][free]
            derivative[free] = 0.0
            derivative[free, places.friction.start + free] = FRICTION_COMPLIANCE
        return left, derivative

    return rows


def _lift_ends(grip: HeldGrip, changes: Iterator[int]) -> HeldGrip | None:
    """
    Return the grip without the face ends, and without the third member, that are in tension.

    The contact with the largest tension is removed, and the equilibrium is computed again.
    `changes` bounds the number of removals. The result is None if no equilibrium exists.
    """
    found: HeldGrip | None = grip
    while found is not None:
        lifted = found.most_pulling(third=True)
        if lifted is None or next(changes, None) is None:
            break
        kept = np.delete(np.arange(len(found.anchors)), lifted)
        contacts = found.contacts.without(lifted)
        found = roll_contacts(
            found, found.config, contacts, found.anchors[kept], found.angles[kept], found.wrench
        )
    return found


def _lay_down(grip: HeldGrip, changes: Iterator[int]) -> HeldGrip:
    """
    Return the grip with contact at each face end that penetrates its bent tube.

    The object rolls over a short face: its far end replaces its near end. Several short faces may
    follow each other.
    """
    corners, done = grip.contacts.corners, set[int]()
    own = grip.state.normals * np.exp(-1j * grip.state.unknowns[2])
    for k, face in open_faces(grip.statics):
        short = is_short(grip.statics, face)
        rolled = face.step * (own[k] * face.normal.conjugate()).imag > 0.0
        if k in done or not (
            rolled if short else far_end_depth(grip.statics, grip.state, k, face) > 0.0
        ):
            continue
        done.add(k)
        laid = None if next(changes, None) is None else _lay(grip, k, face)
        # If the object has rolled over the face in a long motion, this end is in tension.
        laid = None if laid is None else _lift_ends(laid, changes)
        if laid is not None and not np.array_equal(laid.contacts.corners, corners):
            return _lay_down(laid, changes) if short else laid
    return grip


def _join(grip: HeldGrip) -> HeldGrip:
    """Return the grip, with a third member added if a third member has come into contact."""
    if len(grip.members) >= GRIP_SIZES[-1]:
        return grip
    depths = member_depths(grip.config, grip.body)
    depths[grip.members] = -np.inf
    number = int(depths.argmax())
    near = MAX_DISPLACEMENT * grip.config.robot.description.tube_diameter
    if depths[number] <= -near or _depth_in(grip, number, float(depths[number])) <= 0.0:
        return grip
    member = np.array([number])
    others = find_pressed(grip.config, grip.body, member)
    normal = facing_lines(grip.config, grip.body, member)[1] * grip.body.turn.conjugate()
    found = _add(grip, grip.contacts, others, np.repeat(np.angle(normal), len(others.members)))
    if found is None:
        return grip
    presses = found.state.normal_forces[found.contacts.members == number].min() > 0.0
    return found if presses else grip


def _lay(grip: HeldGrip, k: int, face: Face) -> HeldGrip | None:
    """Return the equilibrium with contact at a face's far end; at a short face, only there."""
    anchors, angles, wrench = grip.anchors, grip.angles, grip.wrench
    if is_short(grip.statics, face):
        corners = grip.contacts.corners.copy()
        corners[k] = face.corner
        turned = replace(grip.contacts, corners=corners)
        return roll_contacts(grip, grip.config, turned, anchors, angles, wrench)
    laid, new = with_far_end(grip.contacts, k, face)
    anchors, angles = np.insert(anchors, new, 0.0), np.insert(angles, new, angles[k])
    return roll_contacts(grip, grip.config, laid, anchors, angles, wrench, np.array([new]))


def _add(
    grip: HeldGrip,
    contacts: PressedContacts,
    others: PressedContacts,
    angles: Array,
) -> HeldGrip | None:
    """Return the equilibrium with the contacts of another member added."""
    order = np.argsort(np.append(contacts.members, others.members), kind='stable')
    pairs = (
        (contacts.members, others.members),
        (contacts.corners, others.corners),
        (contacts.cuts, others.cuts),
    )
    return roll_contacts(
        grip,
        grip.config,
        PressedContacts(*(np.concatenate(pair)[order] for pair in pairs)),
        np.append(grip.anchors, np.zeros(len(angles)))[order],
        np.append(grip.angles, angles)[order],
        grip.wrench,
        np.flatnonzero(order >= len(grip.anchors)),
    )


def _depth_in(grip: HeldGrip, number: int, depth: float) -> float:
    """Return the penetration depth of the object in a deformed member without contact [m]."""
    start, end = member_lines(grip.config)[[number]].T
    near = segment_gaps(grip.body, start, end)
    foot = float(near.shares[0]) * abs(end - start)
    return depth - displacement_at(
        grip.statics, grip.state, number, foot, complex(near.normals[0])
    )


def with_pressures(grip: HeldGrip, pressures: Pressure | None) -> HeldGrip:
    """
    Return a held grip with other tube pressures; its equilibrium must be found by `roll_grip`.

    The forces that flatten the tubes are tabulated for each pressure. Computing new tables takes
    longer than a control cycle, so a control loop ignores small changes of pressure, see
    `steady_pressures`.

    :param grip: the grip.
    :param pressures: gauge pressures [Pa], see `tube_pressures`; None: the pressures of the robot
        file.
    :raises StructureError: see `structure_of`.
    """
    if pressures == grip.tubes.pressure:
        return grip
    tubes = grip.tubes._replace(pressure=pressures)
    structure, state = structure_of(grip.config, pressures), grip.state
    bent = grip.statics.bent.update(state.loads, state.feet, structure)
    dents = find_dents(structure, grip.body, grip.contacts, tubes, state.normals)
    statics = replace(grip.statics, bent=bent, dents=dents)
    return replace(grip, tubes=tubes, statics=statics)
