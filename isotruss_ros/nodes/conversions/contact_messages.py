# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contact forces of members as wrenches in the frames of the contacts."""

from __future__ import annotations

from typing import NamedTuple

from geometry_msgs.msg import WrenchStamped
from isotruss_ros.core import Robot
from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis
from isotruss_ros.nodes.conversions.messages import make_header, name_contact_frame


class ContactFrame(NamedTuple):
    """
    Frame of a contact, relative to the robot frame.

    :ivar origin: centre of pressure, x + iy [m].
    :ivar direction: unit vector of the x axis, normal to the object and into it, x + iy.
    """

    origin: complex
    direction: complex


def find_contact_frames(analysis: GraspAnalysis, robot: Robot) -> dict[str, ContactFrame]:
    """
    Return the contact frame of each member in contact, by member.

    :param analysis: analysis of the grasp.
    :param robot: robot with the members.
    """
    frames = {}
    forces = analysis.normal_forces
    points = analysis.points @ (1.0, 1.0j)
    inward = -analysis.normals @ (1.0, 1.0j)
    for number in sorted(set(analysis.members[forces > 0.0].tolist())):
        mine = forces * (analysis.members == number)
        push = complex(mine @ inward)
        if push:
            origin = complex(mine @ points) / float(mine.sum())
            frames[robot.member_names[number]] = ContactFrame(origin, push / abs(push))
    return frames


def to_contact_wrench(
    frame: str, member: str, when: float, normal: float, friction: float = 0.0
) -> WrenchStamped:
    """
    Return the message of a member's force on the object, in its contact frame.

    :param frame: name of the robot frame.
    :param member: name of the member.
    :param when: time of the force [s].
    :param normal: normal force, the component `force.x` [N].
    :param friction: friction force on the object, counter-clockwise around it, minus `force.y`
        [N].
    """
    message = WrenchStamped(header=make_header(when, name_contact_frame(frame, member)))
    message.wrench.force.x, message.wrench.force.y = normal, -friction
    return message
