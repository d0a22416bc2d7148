# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Reading of objects from YAML, given as a file or as the text of a parameter.

    shape: polygon                            # or disc, with diameter; or ellipse, with semi_axes
    vertices: [[0, 0], [0.3, 0], [0.3, 0.2], [0, 0.2]]
    corner_radius: 0.01
    mass: 1.5                                 # optional, like the following keys
    center_of_mass: [0.15, 0.1]
    friction: 0.4
    uncertainty: {friction: 0.05, size: 0.01}
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, MISSING
from pathlib import Path
from typing import Any

from isotruss_ros.core.errors import GraspError, ObjectFileError, quote, suggest
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.ellipse import Ellipse
from isotruss_ros.core.model.polygon import Polygon
from isotruss_ros.core.model.robot_schema import find_faults
from isotruss_ros.core.model.safe_yaml import parse_yaml, read_text
from isotruss_ros.core.model.shapes import Disc

#: Shape classes by name. Their fields are the keys; fields with a default are optional keys.
SHAPES: dict[str, type] = {'disc': Disc, 'polygon': Polygon, 'ellipse': Ellipse}
#: Optional keys of all shapes.
OPTIONAL_KEYS = ('mass', 'center_of_mass', 'friction', 'uncertainty')


def read_object(path_or_text: str | Path) -> ConvexObject:
    """
    Read an object from a YAML file or text, and place it at the origin of the robot frame.

    :param path_or_text: path of a file, or a text that begins with `{`.
    :raises ObjectFileError: the file is missing, is not YAML 1.2, or does not describe an object.
        The message names file, key and valid range.
    """
    return make_object(*read_content(path_or_text, 'object'))


def read_content(path_or_text: str | Path, what: str) -> tuple[Any, str]:
    """Return the content of a YAML file or text, and the name of its source in messages."""
    if isinstance(path_or_text, str) and path_or_text.lstrip().startswith(('{', '[')):
        source, text = what, path_or_text
    else:
        source = str(path_or_text)
        if not isinstance(path_or_text, str | Path) or not source.strip():
            raise ObjectFileError(
                f'{what} {path_or_text!r}: must be the path of a file, or a text that begins '
                'with {'
            )
        text = read_text(Path(path_or_text), 'an object file', ObjectFileError)
    return parse_yaml(source, text, 'object files', ObjectFileError), source


def make_object(content: Any, source: str) -> ConvexObject:
    """Return the object of an object file's keys and values, at the origin of the robot frame."""
    shape = make_shape(content, source, OPTIONAL_KEYS)
    optional_values = {key: content[key] for key in OPTIONAL_KEYS if key in content}
    for fault in find_faults(content.get('uncertainty', {}), 'uncertainty'):
        raise ObjectFileError(f'{source}: uncertainty: {fault}')
    try:
        return ConvexObject(shape, **optional_values)
    except GraspError as error:
        raise ObjectFileError(f'{source}: {error}') from error


def make_shape(
    content: Any, source: str, other_keys: Sequence[str], shapes: Mapping[str, type] = SHAPES
) -> Any:
    """
    Return the shape of the keys and values of an object.

    :param other_keys: keys that the shape does not use.
    :param shapes: classes of the possible shapes by name.
    """
    if not isinstance(content, Mapping):
        raise ObjectFileError(
            f'{source}: {quote(repr(content))}: must be keys and values, with the key shape'
        )
    known = ', '.join(shapes)
    if 'shape' not in content:
        raise ObjectFileError(f"{source}: key 'shape' is missing; it is one of {known}")
    kind = content['shape']
    if not isinstance(kind, str) or kind not in shapes:
        raise ObjectFileError(f'{source}: shape: {quote(str(kind))}: must be one of {known}')
    size_fields = [field for field in fields(shapes[kind]) if field.init]
    allowed = ('shape', *(field.name for field in size_fields), *other_keys)
    for key in content:
        if key not in allowed:
            hint = f'{suggest(str(key), allowed)}those of shape {kind} are {", ".join(allowed)}'
            raise ObjectFileError(f'{source}: unknown key {quote(str(key))}; {hint}')
    for field in size_fields:
        if field.default is MISSING and field.name not in content:
            raise ObjectFileError(f'{source}: key {field.name!r} is missing; a {kind} needs it')
    sizes = {field.name: content[field.name] for field in size_fields if field.name in content}
    try:
        return shapes[kind](**sizes)
    except GraspError as error:
        raise ObjectFileError(f'{source}: {error}') from error
