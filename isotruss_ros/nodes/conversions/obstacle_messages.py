# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Conversion of moving obstacles from messages and to messages."""

from __future__ import annotations

from collections.abc import Sequence
import math

from isotruss_msgs.msg import Obstacle as ObstacleMessage
from isotruss_msgs.msg import Obstacles
from isotruss_ros.core import ConvexObject, Obstacle, Pose
from isotruss_ros.core.errors import GraspError, quote
from isotruss_ros.core.model.obstacle import HalfPlane, MAX_OBSTACLES
from isotruss_ros.nodes.conversions.messages import (
    make_header,
    MessageError,
    read_pose,
    read_stamp,
    read_twist,
    to_pose_message,
    to_twist_message,
)
from isotruss_ros.nodes.conversions.object_messages import read_shape, to_object_message


def read_obstacles(
    message: Obstacles, shift: complex = 0j, turned: float = 0.0
) -> tuple[Obstacle, ...]:
    """
    Return the moving obstacles of a message in the robot frame, with its stamp.

    :param shift: origin of the message's frame in the robot frame, x + iy [m].
    :param turned: angle of the message's frame in the robot frame [rad].
    """
    if (count := len(message.obstacles)) > MAX_OBSTACLES:
        raise MessageError(f'obstacles: {count} in a message; must be at most {MAX_OBSTACLES}')
    names = [entry.name for entry in message.obstacles]
    if len(set(names)) < len(names):
        twice = sorted({quote(name) for name in names if names.count(name) > 1})
        raise MessageError(f'obstacles {", ".join(twice)}: named twice; must be named once')
    stamp = read_stamp(message.header)
    return tuple(_read_obstacle(entry, shift, turned, stamp) for entry in message.obstacles)


def _read_obstacle(
    message: ObstacleMessage, shift: complex, turned: float, stamp: float
) -> Obstacle:
    words = f'obstacle {quote(message.name)}'
    pose = read_pose(words, message.pose, is_at_any_height=True)
    turn = complex(math.cos(turned), math.sin(turned))
    if message.shape.mass or message.shape.center_of_mass or message.shape.friction:
        raise MessageError(f'{words}: mass, center_of_mass and friction must be empty')
    try:
        vx, vy, omega = read_twist(message.velocity)
        shape = read_shape(message.shape, words).shape
        place, velocity = shift + turn * complex(pose.x, pose.y), turn * complex(vx, vy)
        angle = math.remainder(pose.angle + turned, 2.0 * math.pi)
        there, motion = Pose(place.real, place.imag, angle), (velocity.real, velocity.imag, omega)
        return Obstacle(message.name, ConvexObject(shape, there), motion, stamp)
    except (GraspError, MessageError) as error:
        prefix = '' if str(error).startswith(words) else f'{words}: '
        raise MessageError(f'{prefix}{error}') from error


def to_obstacles_message(obstacles: Sequence[Obstacle], time: float, frame: str) -> Obstacles:
    """Convert obstacles in the robot frame to a message with a stamp [s]; walls are refused."""
    entries = []
    for obstacle in obstacles:
        if isinstance(obstacle.body.shape, HalfPlane):
            raise GraspError(f'obstacle {quote(obstacle.name)}: a wall does not move')
        entry = ObstacleMessage(
            name=obstacle.name,
            shape=to_object_message(ConvexObject(obstacle.body.shape)),
            pose=to_pose_message(obstacle.body.pose),
            velocity=to_twist_message(obstacle.velocity),
        )
        entries.append(entry)
    return Obstacles(header=make_header(time, frame), obstacles=entries)
