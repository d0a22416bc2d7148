# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Conversion of state estimates and of held grips to messages and from messages."""

from __future__ import annotations

from geometry_msgs.msg import Point
from isotruss_msgs.msg import HeldGrip as HeldGripMessage
from isotruss_msgs.msg import StateEstimate as StateEstimateMessage
from isotruss_ros.core import Pose, Robot
from isotruss_ros.core.errors import format_numbers, StructureError
from isotruss_ros.core.estimation.state_estimate import EstimatedTravel, StateEstimate
from isotruss_ros.core.holding.contacts import Places, PressedContacts
from isotruss_ros.core.holding.grip_record import GripEstimate, GripRecord
from isotruss_ros.core.numerics.arrays import covariance_matrix
from isotruss_ros.core.statics.tube_stiffness import tube_pressures
from isotruss_ros.nodes.conversions.messages import (
    check_frame,
    HELD_VALUES,
    make_header,
    MAX_DISTANCE,
    MessageError,
    to_pose_message,
)
import numpy as np

#: Indices of x, y and angle in the covariance (6, 6) of a pose.
PLANAR_INDICES = np.ix_([0, 1, 5], [0, 1, 5])  # type: ignore[var-annotated]
#: Largest valid roller offset [m].
MAX_OFFSET = 1.0


def to_estimate_message(estimate: StateEstimate, robot: Robot) -> StateEstimateMessage:
    """Convert a state estimate to a message."""
    message = StateEstimateMessage(
        roller_names=list(robot.roller_names),
        travel=estimate.travel.tolist(),
        offsets=estimate.offsets.tolist(),
        offset_covariance=estimate.offset_covariance.ravel().tolist(),
        improbable=estimate.is_improbable,
        may_be_upright=estimate.may_be_upright,
        joint_names=list(robot.topology.joint_names),
        joints=[Point(x=x, y=y) for x, y in estimate.joints.tolist()],
        joint_deviations=np.sqrt(np.diag(estimate.joint_covariance)).tolist(),
        used_joints=estimate.used,
        left_out_joints=estimate.left_out,
        swapped_joints=estimate.swapped,
        slipping_rollers=estimate.slipping,
        pose_delay=estimate.delay,
        held=HELD_VALUES[True if estimate.pose is not None else None],
    )
    if estimate.pose is not None:
        message.pose.pose = to_pose_message(Pose(*estimate.pose.tolist()))
        covariance = np.zeros((6, 6))
        covariance[PLANAR_INDICES] = estimate.pose_covariance
        message.pose.covariance = covariance.ravel()
        message.squeeze = estimate.squeeze
        message.squeeze_deviation = estimate.squeeze_deviation
    message.header = make_header(estimate.time, robot.frame)
    return message


def read_estimate(message: StateEstimateMessage, robot: Robot) -> EstimatedTravel:
    """Return the roller offsets and their covariance in a message of the estimator."""
    check_frame('state estimate', message.header, robot.frame)
    names, offsets = tuple(message.roller_names), np.array(message.offsets)
    if names != robot.roller_names or len(offsets) != len(names):
        raise MessageError(
            f'state estimate of rollers {", ".join(names)}: must be those of robot {robot.name}'
        )
    if not (np.abs(offsets) <= MAX_OFFSET).all():
        raise MessageError(
            f'state estimate with offsets {format_numbers(offsets)} m: must be finite, at most '
            f'{MAX_OFFSET:g} m'
        )
    covariance = np.array(message.offset_covariance)
    if len(covariance) != len(names) ** 2:
        raise MessageError(
            f'state estimate with {len(covariance)} covariances of offsets: must be '
            f'{len(names) ** 2} finite numbers'
        )
    covariance = covariance.reshape(len(names), len(names))
    words = 'covariance of offsets of the state estimate [m^2]'
    return EstimatedTravel(offsets, covariance_matrix(covariance, len(names), words, MessageError))


def to_grip_message(record: GripRecord | None, robot: Robot, when: float) -> HeldGripMessage:
    """
    Convert the record of a held grip to a message.

    :param record: record of the grip; None if no object is held, for an empty message.
    :param when: time at which the grip was computed [s].
    """
    if record is None:
        return HeldGripMessage(header=make_header(when, robot.frame))
    contacts = record.contacts
    estimate = record.estimate
    message = HeldGripMessage(
        header=make_header(when, robot.frame),
        travel=record.travel.tolist(),
        pressures=record.pressures or (),
        members=[robot.member_names[number] for number in contacts.members.tolist()],
        corners=contacts.corners.tolist(),
        unknowns=record.unknowns.tolist(),
        bent=record.bent.tolist(),
        responses=record.responses.ravel().tolist(),
        squeeze_assumed=record.is_assumed,
    )
    if estimate is not None:
        message.pose, message.pose_covariance = estimate.pose, estimate.pose_covariance.ravel()
        message.squeeze, message.squeeze_deviation = estimate.squeeze, estimate.squeeze_deviation
        message.pose_delay = estimate.delay
        message.joint_displacements = estimate.displacements
        message.joint_displacement_rates = estimate.displacement_rates.ravel()
    return message


def read_grip(message: HeldGripMessage, robot: Robot) -> GripRecord:
    """Return the record of a held grip in a message."""
    check_frame('held grip', message.header, robot.frame)
    if not message.members:
        raise MessageError('held grip: no object is held')
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
        'unknowns': Places.of(count).size,
        'responses': 4 * count * (4 * count + 1),
        'bent': len(message.bent),  # see `GripRecord.restore`
        'pose': 3,
        'squeeze': 1,
        'squeeze_deviation': 1,
        'pose_delay': 1,
        'joint_displacements': 2 * len(robot.topology.joint_names),
        'joint_displacement_rates': 2 * len(robot.topology.joint_names) * len(robot.roller_names),
    }
    numbers = {name: np.array(getattr(message, name), dtype=float).ravel() for name in sizes}
    are_in_range = (np.abs(np.concatenate([*numbers.values()])) <= MAX_DISTANCE).all()
    for name, size in sizes.items():
        values = numbers[name]
        if len(values) != size or not (are_in_range or (np.abs(values) <= MAX_DISTANCE).all()):
            raise MessageError(
                f'held grip with {len(values)} numbers {name}, of size '
                f'{np.abs(values).max(initial=0.0):g} at most: must be {size} numbers from '
                f'{-MAX_DISTANCE:g} to {MAX_DISTANCE:g}'
            )
    if message.pressures:
        try:
            tube_pressures(robot.description, numbers['pressures'])
        except StructureError as error:
            raise MessageError(f'held grip: {error}') from error
    contacts = PressedContacts(np.array(known), np.array(message.corners, dtype=np.intp))
    covariance = np.array(message.pose_covariance).reshape(3, 3)
    words = 'pose covariance of the held grip [m^2, m rad, rad^2]'
    estimate = GripEstimate(
        numbers['pose'],
        covariance_matrix(covariance, 3, words, MessageError),
        message.squeeze,
        message.squeeze_deviation,
        message.pose_delay,
        numbers['joint_displacements'],
        numbers['joint_displacement_rates'].reshape(-1, len(robot.roller_names)),
    )
    return GripRecord(
        numbers['travel'],
        contacts,
        numbers['unknowns'],
        numbers['bent'],
        numbers['responses'].reshape(count, 4, -1),
        tuple(message.pressures) or None,
        estimate,
        message.squeeze_assumed,
    )
