# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Conversion of convex objects to messages and from messages."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from geometry_msgs.msg import Point
from geometry_msgs.msg import Pose as PoseMessage
from isotruss_msgs.msg import ConvexObject as ObjectMessage
from isotruss_ros.core import ConvexObject
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.model.object_file import make_object, SHAPES
from isotruss_ros.nodes.conversions.messages import MessageError, read_pose
import numpy as np

#: Name of a shape in object files, by its code in messages.
SHAPE_NAMES = {
    ObjectMessage.DISC: 'disc',
    ObjectMessage.POLYGON: 'polygon',
    ObjectMessage.ELLIPSE: 'ellipse',
}


def read_described(
    message: ObjectMessage, pose: PoseMessage, name: str, diameter: float
) -> ConvexObject | None:
    """
    Return the object that a request describes, at a pose; None if it describes no object.

    :param pose: pose of the object in the robot frame.
    :param diameter: diameter of a disc [m].
    """
    if message == ObjectMessage():
        return None
    if diameter != 0.0:
        raise MessageError(
            f'{name} {diameter} m, together with an `object`: must be 0, because the object is '
            'described; or omit `object` for a disc'
        )
    place = read_pose('object_pose', pose)
    return read_shape(message, 'object').moved_to(place)


def read_shape(message: ObjectMessage, words: str) -> ConvexObject:
    """Return the object of a message at the origin; `words` name it in messages of errors."""
    if message.shape not in SHAPE_NAMES:
        known = ', '.join(f'{number} (a {name})' for number, name in SHAPE_NAMES.items())
        raise MessageError(f'{words}: shape {message.shape}: must be one of {known}')
    radii, axes = message.corner_radii.tolist(), message.semi_axes.tolist()
    # Values by key, without fields that have the defaults of the message.
    fields = {
        'diameter': [message.diameter] if message.diameter != 0.0 else [],
        'vertices': [[_planar(vertex) for vertex in message.vertices]] if message.vertices else [],
        'corner_radius': radii if len(radii) < 2 else [radii],
        'semi_axes': [axes] if any(axes) else [],
        'mass': message.mass,
        'center_of_mass': [_planar(point) for point in message.center_of_mass],
        'friction': message.friction,
    }
    content = {key: values[0] for key, values in fields.items() if len(values)}
    try:
        return make_object({'shape': SHAPE_NAMES[message.shape]} | content, words)
    except GraspError as error:
        raise MessageError(str(error)) from error


def to_object_message(body: ConvexObject) -> ObjectMessage:
    """Convert an object without its pose to a message."""
    shape: Any = body.shape
    numbers = {SHAPES[name]: number for number, name in SHAPE_NAMES.items()}
    if type(shape) not in numbers:
        known = ', '.join(kind.__name__ for kind in numbers)
        raise GraspError(f'shape {shape!r}: must be one of {known} in a message')
    x, y = body.center_of_mass or (0.0, 0.0)
    sizes = {field.name: getattr(shape, field.name) for field in fields(shape)}
    return ObjectMessage(
        shape=numbers[type(shape)],
        corner_radii=np.atleast_1d(sizes.pop('corner_radius', [])).tolist(),
        vertices=[Point(x=p, y=q) for p, q in sizes.pop('vertices', ())],
        mass=[] if body.mass is None else [body.mass],
        center_of_mass=[] if body.center_of_mass is None else [Point(x=x, y=y)],
        friction=[] if body.friction is None else [body.friction],
        **sizes,
    )


def _planar(point: Point) -> tuple[float, float]:
    return point.x, point.y
