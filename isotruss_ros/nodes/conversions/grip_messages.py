# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Conversion of held grips to messages and from messages."""

from __future__ import annotations

from isotruss_msgs.msg import HeldGrip as HeldGripMessage
from isotruss_ros.core import Robot
from isotruss_ros.core.holding.contact_forces import Places, PressedContacts
from isotruss_ros.core.holding.grip_record import GripRecord
from isotruss_ros.nodes.conversions.messages import (
    check_frame,
    make_header,
    MAX_DISTANCE,
    MessageError,
)
import numpy as np


def to_grip_message(record: GripRecord, robot: Robot, when: float) -> HeldGripMessage:
    """
    Return the message of a held grip.

    :param when: time of the grip [s].
    """
    contacts = record.contacts
    before, behind = contacts.cuts.T.tolist()
    return HeldGripMessage(
        header=make_header(when, robot.frame),
        travel=record.travel.tolist(),
        pressures=record.pressures or (),
        members=[robot.member_names[number] for number in contacts.members.tolist()],
        corners=contacts.corners.tolist(),
        before=before,
        behind=behind,
        unknowns=record.unknowns.tolist(),
    )


def read_grip(message: HeldGripMessage, robot: Robot) -> GripRecord:
    """
    Return the record of a held grip.

    :raises MessageError: the message has another frame, contacts that the robot cannot have, lists
        of different lengths, or values that are not finite.
    """
    check_frame('held grip', message.header, robot.frame)
    names, count = robot.member_names, len(message.members)
    known = [names.index(name) for name in message.members if name in names]
    if len(known) < count or known != sorted(known) or len(set(known)) < 2:
        raise MessageError(
            f'held grip by members {", ".join(message.members)}: must be two or more of robot '
            f'{robot.name}, in its order'
        )
    sizes = {
        'travel': len(robot.roller_names),
        'pressures': len(robot.description.pressures) if message.pressures else 0,
        'corners': count,
        'before': count,
        'behind': count,
        'unknowns': Places.of(count).size,
    }
    for name, size in sizes.items():
        values = np.array(getattr(message, name), dtype=float)
        # The reach of a contact on a corner is infinite.
        least, most = (0.0, np.inf) if name[:2] == 'be' else (-MAX_DISTANCE, MAX_DISTANCE)
        if len(values) != size or not ((least <= values) & (values <= most)).all():
            raise MessageError(
                f'held grip with {name} {values.tolist()}: must be {size} numbers from {least:g} '
                f'to {most:g}'
            )
    cuts = np.column_stack([message.before, message.behind])
    contacts = PressedContacts(np.array(known), np.array(message.corners, dtype=np.intp), cuts)
    pressures = tuple(message.pressures) or None
    return GripRecord(np.array(message.travel), contacts, np.array(message.unknowns), pressures)
