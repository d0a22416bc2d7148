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

from collections.abc import Mapping
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
    if isinstance(path_or_text, str) and path_or_text.lstrip().startswith('{'):
        source, text = 'object', path_or_text
    else:
        source = str(path_or_text)
        if not isinstance(path_or_text, str | Path) or not source.strip():
            raise ObjectFileError(
                f'object {path_or_text!r}: must be the path of a file, or a text that begins '
                'with {'
            )
        text = read_text(Path(path_or_text), 'an object file', ObjectFileError)
    return make_object(parse_yaml(source, text, 'object files', ObjectFileError), source)


def make_object(content: Any, source: str) -> ConvexObject:
    """Return the object of an object file's keys and values, at the origin of the robot frame."""
    if not isinstance(content, Mapping):
        raise ObjectFileError(
            f'{source}: {quote(repr(content))}: must be keys and values, with the key shape'
        )
    shapes = ', '.join(SHAPES)
    if 'shape' not in content:
        raise ObjectFileError(f"{source}: key 'shape' is missing; it is one of {shapes}")
    kind = content['shape']
    if not isinstance(kind, str) or kind not in SHAPES:
        raise ObjectFileError(f'{source}: shape: {quote(str(kind))}: must be one of {shapes}')
    size_fields = fields(SHAPES[kind])
    allowed = ('shape', *(field.name for field in size_fields), *OPTIONAL_KEYS)
    for key in content:
        if key not in allowed:
            hint = f'{suggest(str(key), allowed)}those of shape {kind} are {", ".join(allowed)}'
            raise ObjectFileError(f'{source}: unknown key {quote(str(key))}; {hint}')
    for field in size_fields:
        if field.default is MISSING and field.name not in content:
            raise ObjectFileError(f'{source}: key {field.name!r} is missing; a {kind} needs it')
    sizes = {field.name: content[field.name] for field in size_fields if field.name in content}
    optional_values = {key: content[key] for key in OPTIONAL_KEYS if key in content}
    for fault in find_faults(content.get('uncertainty', {}), 'uncertainty'):
        raise ObjectFileError(f'{source}: uncertainty: {fault}')
    try:
        return ConvexObject(SHAPES[kind](**sizes), **optional_values)
    except GraspError as error:
        raise ObjectFileError(f'{source}: {error}') from error
