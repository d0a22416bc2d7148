# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reading of roller states, tube pressures and measured joint positions from messages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math

from geometry_msgs.msg import Transform
from isotruss_ros.core import Robot
from isotruss_ros.core.errors import format_numbers, quote, StructureError
from isotruss_ros.core.statics.tube_stiffness import tube_pressures
from isotruss_ros.nodes.conversions.messages import (
    check_place,
    ForeignMessageError,
    MAX_DISTANCE,
    MessageError,
)
from sensor_msgs.msg import FluidPressure, JointState, MultiDOFJointState

#: Largest valid roller speed [m/s]; larger values come from a broken sensor.
MAX_SPEED = 10.0


#: Largest number of names in a text [-].
MAX_NAMES = 3


def quote_names(names: Sequence[str]) -> str:
    """Return a text with the first names of a message; 'no joint' without names."""
    return ', '.join(map(quote, names[:MAX_NAMES])) or 'no joint'


def read_joint_markers(
    message: MultiDOFJointState, robot: Robot
) -> dict[str, tuple[float, float, float]]:
    """Return the position (x, y, z) in the message's frame for each joint name [m]."""
    if len(message.joint_names) != len(message.transforms):
        raise MessageError(
            f'joint markers: {len(message.joint_names)} names and {len(message.transforms)} '
            'transforms: both numbers must be equal'
        )
    known, positions = robot.topology.joint_names, {}
    if not any(name in known for name in message.joint_names):
        raise ForeignMessageError(
            f'joint marker {quote_names(message.joint_names)}: must be one of {", ".join(known)}'
        )
    for name, transform in zip(message.joint_names, message.transforms, strict=True):
        if name not in known or name in positions:
            raise MessageError(
                f'joint marker {quote(name)}: must be one of {", ".join(known)}, each once'
            )
        place = transform.translation
        check_place(f'joint marker {name}', place.x, place.y)
        positions[name] = place.x, place.y, place.z
    return positions


def to_joint_markers(joints: Mapping[str, Sequence[float]]) -> MultiDOFJointState:
    """
    Convert measured joint positions to a message with an empty header.

    :param joints: position (x, y) for the name of each joint [m].
    """
    message = MultiDOFJointState(joint_names=list(joints))
    for x, y in joints.values():
        transform = Transform()
        transform.translation.x, transform.translation.y = float(x), float(y)
        message.transforms.append(transform)
    return message


def read_roller_part(message: JointState, names: Sequence[str]) -> dict[int, tuple[float, float]]:
    """
    Return travel [m] and speed [m/s] for the index of each roller in a message.

    Joints that are no rollers are ignored. A speed that is missing or NaN is replaced by zero;
    some broadcasters send NaN if the speed is not measured.

    :raises ForeignMessageError: no joint of the message is a roller.
    """
    numbers = {name: number for number, name in enumerate(names)}
    places = [place for place, name in enumerate(message.name) if name in numbers]
    indices = [numbers[message.name[place]] for place in places]
    if len(indices) > len(set(indices)):
        twice = sorted({names[number] for number in indices if indices.count(number) > 1})
        raise MessageError(f'joint states: {", ".join(twice)} named twice; must be named once')
    if not indices:
        raise ForeignMessageError(
            f'joint states of {quote_names(message.name)}: must name {", ".join(names)}, in one '
            'message or in parts'
        )

    def select(what: str, values: Sequence[float]) -> list[float]:
        if len(values) != len(message.name):
            raise MessageError(
                f'joint states: {len(values)} {what} for {len(message.name)} names; '
                'both numbers must be equal'
            )
        return [values[place] for place in places]

    positions, velocities = select('positions', message.position), [0.0] * len(places)
    if not all(abs(position) <= MAX_DISTANCE for position in positions):  # nor for NaN
        raise MessageError(
            f'joint states: roller positions {format_numbers(positions)} m: must be finite, '
            f'at most {MAX_DISTANCE:g} m'
        )
    if message.velocity:
        measured = select('velocities', message.velocity)
        velocities = [0.0 if math.isnan(velocity) else velocity for velocity in measured]
    if any(abs(velocity) > MAX_SPEED for velocity in velocities):
        raise MessageError(
            f'joint states: roller velocities {format_numbers(velocities)} m/s: '
            f'must be at most {MAX_SPEED} m/s'
        )
    return dict(zip(indices, zip(positions, velocities, strict=True), strict=True))


def read_tube_pressure(message: FluidPressure, robot: Robot, ambient: float) -> tuple[str, float]:
    """
    Return the name of a tube and its gauge pressure [Pa] from a message.

    :param message: message of the topic `tube_pressures`, with the name of the tube in
        `header.frame_id`.
    :param ambient: ambient pressure that is subtracted [Pa]; 0 if the message contains a gauge
        pressure.
    """
    known, tube = tuple(robot.description.pressures), message.header.frame_id
    if tube not in known:
        raise ForeignMessageError(
            f'tube pressures: frame_id {quote(tube)}: must be one of {", ".join(known)}'
        )
    pressure = message.fluid_pressure - ambient
    try:
        tube_pressures(robot.description, {tube: pressure})
    except StructureError as error:
        raise MessageError(f'tube pressures: {error}') from error
    return tube, pressure
