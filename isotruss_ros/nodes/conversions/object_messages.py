# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Objects of any convex shape from messages, and to messages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from geometry_msgs.msg import Point
from geometry_msgs.msg import Pose as PoseMessage
from isotruss_msgs.msg import ConvexObject as ObjectMessage
from isotruss_ros.core import ConvexObject, Disc, Ellipse, Polygon
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.nodes.conversions.messages import MessageError, read_pose
import numpy as np

NO_OBJECT = ObjectMessage()


def describes_object(message: ObjectMessage) -> bool:
    """
    Return whether a message describes an object, be it a bad one; a new message does not.

    :param message: of an object.
    """
    return message != NO_OBJECT


def read_object_message(message: ObjectMessage, pose: PoseMessage) -> ConvexObject:
    """
    Return the object that a message describes, in its place.

    :param message: of the object.
    :param pose: of its frame in the robot frame.
    :raises MessageError: it describes no object, has a field that its shape does not have, or the
        pose is not usable; names the field, and the vertex or the side of a polygon.
    """
    place = read_pose('object_pose', pose)
    if message.shape not in SHAPES:
        known = ', '.join(f'{number} ({kind.name})' for number, kind in SHAPES.items())
        raise MessageError(f'object: shape {message.shape}: must be one of {known}')
    kind = SHAPES[message.shape]
    for name in FIELDS:
        if name not in kind.fields and _is_given(getattr(message, name)):
            raise MessageError(
                f'object: {name}: {kind.name} has none; must be left out, the fields of '
                f'{kind.name} are {", ".join(kind.fields)}'
            )
    try:
        return ConvexObject(
            kind.read(message),
            place,
            message.mass[0] if message.mass else None,
            _planar(message.center_of_mass[0]) if message.center_of_mass else None,
            message.friction[0] if message.friction else None,
        )
    except GraspError as error:
        raise MessageError(f'object: {error}') from error


def to_object_message(body: ConvexObject) -> ObjectMessage:
    """
    Return an object as a message, without its pose.

    :param body: the object, anywhere.
    """
    message, shape = ObjectMessage(), body.shape
    if type(shape) not in NUMBERS:
        known = ', '.join(kind.__name__ for kind in NUMBERS)
        raise GraspError(f'shape {shape!r}: must be one of {known} in a message')
    message.shape = NUMBERS[type(shape)]
    for name, value in SHAPES[message.shape].fields_of(shape).items():
        setattr(message, name, value)
    if body.mass is not None:
        message.mass = [body.mass]
    if body.center_of_mass is not None:
        x, y = body.center_of_mass
        message.center_of_mass = [Point(x=x, y=y)]
    if body.friction is not None:
        message.friction = [body.friction]
    return message


def _read_polygon(message: ObjectMessage) -> Polygon:
    radii = tuple(message.corner_radii)
    if len(radii) < 2:
        return Polygon([_planar(v) for v in message.vertices], radii[0] if radii else 0.0)
    return Polygon([_planar(v) for v in message.vertices], radii)


def _polygon_fields(shape: Polygon) -> dict[str, Any]:
    return {
        'vertices': [Point(x=x, y=y) for x, y in shape.vertices],
        'corner_radii': np.atleast_1d(shape.corner_radius).tolist(),
    }


def _planar(point: Point) -> tuple[float, float]:
    return point.x, point.y


def _is_given(value: Any) -> bool:
    """Return whether a field is not as in a new message; what is not a number is given, too."""
    if isinstance(value, float):
        return value != 0.0
    return bool((value != 0.0).any()) if isinstance(value, np.ndarray) else len(value) > 0


class _ShapeMessage(NamedTuple):
    """How a kind of shape is in a message."""

    name: str
    shape: type
    fields: tuple[str, ...]
    read: Callable[[ObjectMessage], Shape]
    fields_of: Callable[[Any], dict[str, Any]]


#: How each kind of shape is in a message, by its number there.
SHAPES: dict[int, _ShapeMessage] = {
    ObjectMessage.DISC: _ShapeMessage(
        'a disc',
        Disc,
        ('diameter',),
        lambda message: Disc(message.diameter),
        lambda shape: {'diameter': shape.diameter},
    ),
    ObjectMessage.POLYGON: _ShapeMessage(
        'a polygon', Polygon, ('vertices', 'corner_radii'), _read_polygon, _polygon_fields
    ),
    ObjectMessage.ELLIPSE: _ShapeMessage(
        'an ellipse',
        Ellipse,
        ('semi_axes',),
        lambda message: Ellipse(tuple(message.semi_axes.tolist())),
        lambda shape: {'semi_axes': shape.semi_axes},
    ),
}
NUMBERS = {kind.shape: number for number, kind in SHAPES.items()}
#: The fields of the message that only some shapes have.
FIELDS = tuple(name for kind in SHAPES.values() for name in kind.fields)
