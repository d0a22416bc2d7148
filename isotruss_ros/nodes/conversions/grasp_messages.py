# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Conversion of grasp analyses to messages, and of requests and wrenches from messages."""

from __future__ import annotations

import cmath
from collections.abc import Mapping, Sequence
import math

from geometry_msgs.msg import Point, Pose, Vector3, Wrench, WrenchStamped
from isotruss_msgs.msg import Contact, GraspState
from isotruss_msgs.srv import AnalyzeGrasp
from isotruss_ros.core import ConvexObject
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.held_shape import contact_points
from isotruss_ros.core.numerics.arrays import finite_array, MAX_LOAD
from isotruss_ros.nodes.conversions.messages import (
    ALIGNED_OBJECT,
    check_frame,
    CONTACT,
    HELD_VALUES,
    make_header,
    MessageError,
    name_frame,
    OBJECT,
)
from isotruss_ros.nodes.conversions.object_messages import read_described
from isotruss_ros.nodes.grasp.grasp_report import GraspQuery, GraspReport

#: Fields of a settled grasp that are mappings by member; in messages they are lists in the order
#: of `contact_members`.
MEMBER_FIELDS = (
    'contact_lengths',
    'contact_widths',
    'contact_areas',
    'contact_pressures',
    'peak_pressures',
)


def read_external_wrench(
    message: WrenchStamped, frame: str, angle: float | None = None
) -> tuple[float, float, float]:
    """
    Return the external wrench (fx, fy, m) on the object in a message, in robot axes [N, N m].

    :param message: wrench about the object's origin, in the aligned frame (see `ALIGNED_OBJECT`)
        or in the object's frame.
    :param angle: angle of the object in the robot frame [rad]; None if unknown.
    """
    wrench = _planar(message.wrench)
    what = 'external wrench (force.x, force.y [N], torque.z [N m])'
    finite_array(wrench, 3, what, MessageError, MAX_LOAD)
    if frame and message.header.frame_id == name_frame(frame, OBJECT) and angle is not None:
        fx, fy, m = wrench
        force = complex(fx, fy) * cmath.rect(1.0, angle)
        wrench = force.real, force.imag, m
    else:
        check_frame('external wrench', message.header, name_frame(frame, ALIGNED_OBJECT))
    return wrench


def to_wrench_message(wrench: Sequence[float]) -> Wrench:
    """
    Convert a planar wrench to a message.

    :param wrench: planar wrench (fx, fy, m) [N, N m].
    """
    fx, fy, m = map(float, wrench)
    return Wrench(force=Vector3(x=fx, y=fy), torque=Vector3(z=m))


def to_contact_wrench(
    frame: str, member: str, when: float, normal: float, friction: float = 0.0
) -> WrenchStamped:
    """
    Return a message with a member's force on the object, in the member's contact frame.

    :param normal: normal force, the component `force.x` [N].
    :param friction: friction force on the object, counter-clockwise positive; `force.y` has the
        opposite sign [N].
    """
    message = WrenchStamped(header=make_header(when, name_frame(frame, member + CONTACT)))
    message.wrench.force.x, message.wrench.force.y = normal, -friction
    return message


class ContactForces:
    """Messages of the contact forces of the grasping members, zero for those without contact."""

    def __init__(self, frame: str) -> None:
        self._frame, self._grasping = frame, list[str]()

    def make_messages(
        self, when: float, normal: Mapping[str, float], friction: Mapping[str, float]
    ) -> list[WrenchStamped]:
        """
        Return a message for each grasping member, and for each that grasped before.

        :param normal: normal force of each grasping member [N]; empty without contact.
        :param friction: friction force of each, see `to_contact_wrench` [N]; empty if unknown.
        """
        released = [name for name in self._grasping if name not in normal]
        self._grasping = list(normal) or self._grasping
        return [
            to_contact_wrench(
                self._frame, name, when, normal.get(name, 0.0), friction.get(name, 0.0)
            )
            for name in (*normal, *released)
        ]


def read_query(request: AnalyzeGrasp.Request, spacing: float) -> GraspQuery:
    """
    Convert the request of a grasp analysis; here only its object is checked.

    :param spacing: spacing of the contact points along the tubes [m].
    """
    body = _read_body(request)
    wrench = _planar(request.external_wrench)
    rollers = tuple(request.roller_positions)
    friction = request.friction if body.friction is None else body.friction
    return GraspQuery(rollers, body, friction, wrench, spacing)


def _read_body(request: AnalyzeGrasp.Request) -> ConvexObject:
    """Return the object of a request: a disc, or the described object."""
    diameter, center = request.diameter, request.center
    body = read_described(request.object, request.object_pose, 'diameter', diameter)
    if body is None:
        if diameter == 0.0:
            raise MessageError(
                'diameter 0.0 m: must be positive for a disc at `center`; otherwise `object` must '
                'describe the object at `object_pose`'
            )
        if request.object_pose != Pose():
            raise MessageError(
                'object_pose: must be omitted without an `object`; the position of a disc is '
                '`center`'
            )
        return ConvexObject.disc((center.x, center.y), diameter)
    if center != Point():
        raise MessageError(
            f'center ({center.x}, {center.y}), together with an `object`: must be omitted; the '
            'position of an object is in `object_pose`'
        )
    return body


def _planar(wrench: Wrench) -> tuple[float, float, float]:
    """Return the components (fx, fy, m) of a wrench in the robot's plane [N, N m]."""
    return wrench.force.x, wrench.force.y, wrench.torque.z


def to_state_message(report: GraspReport, frame: str) -> GraspState:
    """
    Convert a grasp report to a message; for a report without result, with the worst values.

    The nonlinearity is NaN, because it takes a fifth of the time of an analysis.
    """
    state = GraspState(code=int(report.code), message=report.message)
    state.chance = state.nonlinearity = math.nan
    state.squeeze_deviation = report.squeeze_deviation
    state.squeeze_assumed = report.is_squeeze_assumed
    state.held = HELD_VALUES[report.held]
    state.header = make_header(report.time, frame)
    if report.grasp is None:
        state.closure_residual = state.required_friction = math.inf
        state.closure_margin = -math.inf
        return state
    settled, analysis = report.grasp.settled, report.grasp.analysis
    state.force_closure = report.force_closure
    state.hold_message = settled.reason
    state.grasping_members = list(settled.normal_forces)
    state.squeeze = list(settled.normal_forces.values())
    state.friction_used = list(settled.friction_used.values())
    state.slip_margin, state.slip_direction = settled.slip_margin, settled.slip_direction
    state.displacement, state.chance = settled.displacement, report.grasp.chance
    if settled.equilibrium is not None:
        state.contacts = _to_contact_messages(settled.equilibrium)
        state.members = list(settled.utilisation)
        state.utilisation = list(settled.utilisation.values())
        state.utilisation_places = list(settled.utilisation_places.values())
    state.contact_members = list(settled.contact_lengths)
    for name in MEMBER_FIELDS:
        setattr(state, name, list(getattr(settled, name).values()))
    state.stiffness = settled.stiffness.ravel()
    state.closed_by_friction = analysis.closed_by_friction
    for name in ('closure_residual', 'closure_tolerance', 'required_friction', 'closure_margin'):
        setattr(state, name, getattr(analysis, name))
    state.normal_wrench = to_wrench_message(analysis.normal_wrench)
    state.computing_time = report.grasp.computing_time
    return state


def _to_contact_messages(grip: HeldGrip) -> list[Contact]:
    """Return a message for each contact of a held object: a corner, or an end of a face."""
    points, state = contact_points(grip), grip.state
    return [
        Contact(
            position=Point(x=point.real, y=point.imag),
            normal=Vector3(x=normal.real, y=normal.imag),
            normal_force=pressing,
            friction_force=-rubbing,
        )
        for point, normal, pressing, rubbing in zip(
            points.tolist(),
            state.normals.tolist(),
            state.normal_forces.tolist(),
            state.friction_forces.tolist(),
            strict=True,
        )
    ]
