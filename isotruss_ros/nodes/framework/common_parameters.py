# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters that several nodes have in common: robot, object, grip and rates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from isotruss_ros.core import (
    ConvexObject,
    Disc,
    inputs,
    Obstacle,
    read_object,
    read_obstacles,
    Robot,
)
from isotruss_ros.core.manipulation.grip import find_members, Grip, members_at
from isotruss_ros.core.model.convex_object import DEFAULT_FRICTION
from isotruss_ros.core.servo import servo_settings
from isotruss_ros.nodes.framework.parameters import FixedSpec, Parameters, Spec, Value

OBJECT_DIAMETER = Spec('object_diameter', 0.3, 'Diameter of the object [m]', (0.001, 10.0))
OBJECT = FixedSpec(
    'object',
    '',
    'Path of a YAML file that describes the object, or YAML text in braces; empty: a disc of '
    'object_diameter',
)
OBSTACLES = FixedSpec(
    'obstacles',
    '',
    'Path of a YAML file with the obstacles at rest, or YAML text in braces; empty: none',
)
GRIP_MODULE = Spec(
    'grip_module',
    '',
    'Name t/j of the module whose two members hold the object; empty: the last module',
)
GRIP = Spec(
    'grip',
    [''],
    "Names t/j-k of the two or three members that hold the object; ['']: the members of "
    'grip_module',
)
FRICTION = Spec(
    'friction',
    DEFAULT_FRICTION,
    'Coefficient of friction between tube and object [-]',
    (0.0, 10.0),
)
#: Parameters of the object.
OBJECT_SPECS = (OBJECT_DIAMETER, OBJECT, FRICTION)
# At least the rate of MemberLengthLimit, which guarantees the limits in loops of that rate.
RATE = Spec('rate', 100.0, 'Cycles per second [Hz]', (10.0, 2000.0))
COMMAND_TIMEOUT = Spec(
    'command_timeout', 0.2, 'Largest age of inputs [s]', (0.001, inputs.MAX_TIMEOUT)
)
OBSTACLE_TIMEOUT = Spec(
    'obstacle_timeout',
    servo_settings.OBSTACLE_TIMEOUT,
    'Largest age of moving obstacles [s]; an older one stops the rollers; plans leave it out',
    (0.001, inputs.MAX_TIMEOUT),
)
PRESSURE_TIMEOUT = Spec(
    'pressure_timeout',
    inputs.PRESSURE_TIMEOUT,
    'Largest age of tube pressures [s]',
    (0.001, 3600.0),
)
AMBIENT_PRESSURE = Spec(
    'ambient_pressure',
    0.0,
    'Ambient pressure, which is subtracted from tube_pressures [Pa]; 0 for gauge pressures',
    (0.0, 1.2e5),
)
USE_STAMPED_TWIST = FixedSpec(
    'use_stamped_twist', False, 'Whether cmd_vel is a TwistStamped instead of a Twist'
)
REQUIRE_EMERGENCY_STOP = Spec(
    'require_emergency_stop',
    False,
    'Whether a message of emergency_stop must be received before the first motion',
)


def read_described(values: Parameters) -> ConvexObject | None:
    """
    Return the object that the parameter `object` describes; None if the parameter is empty.

    For None, nodes use a disc with the diameter `object_diameter`, see `make_body`.
    """
    return read_object(values.object) if values.object else None


def read_resting_obstacles(values: Parameters) -> tuple[Obstacle, ...]:
    """Return the obstacles that the parameter `obstacles` describes."""
    return read_obstacles(values.obstacles) if values.obstacles else ()


def make_body(values: Parameters, described: ConvexObject | None) -> ConvexObject:
    """
    Return the described object, or else a disc; an object without friction gets the parameter's.

    :param described: object of the parameter `object`; None for a disc with the parameter
        `object_diameter`.
    """
    body = described or ConvexObject(Disc(values.object_diameter))
    return body if body.friction is not None else replace(body, friction=values.friction)


def check_grip(robot: Robot, values: Mapping[str, Value]) -> None:
    """
    Raise IsotrussError if the robot lacks the module or members of the grip parameters.

    :param values: new values for the names of parameters; other parameters than `grip` and
        `grip_module` are ignored.
    """
    if values.get('grip_module'):
        members_at(robot, values['grip_module'])  # type: ignore[arg-type]
    if names := named_members(values.get('grip', [])):
        find_members(robot.topology, Grip(names, ConvexObject(Disc(1.0))).members)


def named_members(value: Value) -> tuple[str, ...]:
    """Return the members that the parameter `grip` names; [''] means none."""
    return tuple(name for name in value if name)  # type: ignore[union-attr]


def select_grip(robot: Robot, values: Parameters) -> tuple[str, ...]:
    """Return the members of `grip`, else those at `grip_module`, else at the last module."""
    module = values.grip_module or robot.module_names[-1]
    return named_members(values.grip) or members_at(robot, module)
