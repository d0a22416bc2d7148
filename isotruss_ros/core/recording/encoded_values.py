# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Values of a recorded cycle as parts of a JSON text, with the names of their fields.

A text executes nothing, so recordings of strangers can be read. Real numbers keep all their bits.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Set
from dataclasses import fields, is_dataclass
import enum
from typing import Any

from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.estimation.state_estimate import EstimatedTravel
from isotruss_ros.core.inputs import InputFault, RejectedInput, RollerState, StampedInput
from isotruss_ros.core.manipulation.grip import CornerGap, Grip
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.ellipse import Ellipse
from isotruss_ros.core.model.obstacle import HalfPlane, Obstacle
from isotruss_ros.core.model.polygon import Polygon
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.model.shapes import Disc, Shape
from isotruss_ros.core.safety.shape_guard import ShapeBounds
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
import numpy as np

#: Classes of recorded values by name; beside them, only imported shapes are constructed.
KINDS: dict[str, Any] = {
    kind.__name__: kind
    for kind in (
        StampedInput,
        RejectedInput,
        RollerState,
        EstimatedTravel,
        Pose,
        Grip,
        CornerGap,
        ConvexObject,
        Disc,
        Ellipse,
        Polygon,
        HalfPlane,
        Obstacle,
        ServoSettings,
        SqueezeSettings,
        ShapeBounds,
    )
}
PLAIN = {type(None), bool, int, float, str}
ENUMS: dict[str, Any] = {'Status': Status, 'InputFault': InputFault}


class RecordedCycleError(IsotrussError, ValueError):
    """Error: the record of a cycle is invalid; the text names its field."""


def encode(value: Any) -> Any:
    """
    Return a value as dictionaries, lists, texts and numbers with the names of its fields.

    :raises RecordedCycleError: the value is of a class without named fields.
    """
    if type(value) in PLAIN:
        return value
    if isinstance(value, enum.Enum):
        return {'enum': type(value).__name__, 'name': value.name}
    if isinstance(value, np.ndarray):
        return {'array': value.tolist()}
    if isinstance(value, np.generic):
        return value.item()
    if is_dataclass(value):
        names = [field.name for field in fields(value) if field.init]
    elif hasattr(value, '_fields'):
        names = value._fields
    elif isinstance(value, Mapping):
        return {'mapping': {name: encode(part) for name, part in value.items()}}
    elif isinstance(value, Set):
        return sorted(map(encode, value))
    elif isinstance(value, tuple | list):
        return list(map(encode, value))
    else:
        raise RecordedCycleError(f'{type(value).__name__}: must be a dataclass to be recorded')
    return {'kind': type(value).__name__} | {n: encode(getattr(value, n)) for n in names}


def decode(value: Any) -> Any:
    """Return the value of a text's part; any error means that the part is invalid."""
    if isinstance(value, list):
        return tuple(map(decode, value))
    if not isinstance(value, dict):
        return value
    if 'array' in value:
        return np.array(value['array'], dtype=float)
    if 'mapping' in value:
        return {name: decode(part) for name, part in value['mapping'].items()}
    try:
        if 'enum' in value:
            return ENUMS[value['enum']][value['name']]
        name = value['kind']
        kind = KINDS.get(name) or {shape.__name__: shape for shape in _own_shapes()}[name]
    except KeyError as error:
        raise RecordedCycleError(
            f'{error}: no known class or value; the module of an own shape must be imported before'
        ) from None
    return kind(**{name: decode(part) for name, part in value.items() if name != 'kind'})


def _own_shapes() -> Iterator[type[Shape]]:
    """Yield the imported classes of shapes."""
    kinds: list[Any] = [Shape]
    while kinds:
        kinds += (kind := kinds.pop()).__subclasses__()
        yield kind


def find_changes(before: ServoSettings, after: ServoSettings) -> list[str]:
    """Return a text such as `squeeze.force: 30.0 -> 40.0` for each setting that differs."""
    old, new = (dict(_flatten(encode(settings))) for settings in (before, after))
    return [
        f'{name}: {old.get(name)} -> {new.get(name)}'
        for name in old | new
        if old.get(name) != new.get(name)
    ]


def _flatten(value: Any, name: str = '') -> Iterator[tuple[str, Any]]:
    """Yield the names, such as `squeeze.force`, and the parts of an encoded value."""
    if isinstance(value, list) and any(isinstance(part, dict | list) for part in value):
        value = dict(enumerate(value))
    if isinstance(value, dict):
        for inner, part in value.items():
            yield from _flatten(part, f'{name}.{inner}' if name else inner)
    else:
        yield name, value
