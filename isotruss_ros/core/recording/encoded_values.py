# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Values of a recorded cycle as parts of a JSON text, with the names of their fields.

A text executes nothing, so recordings of strangers can be read. Real numbers keep all their bits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
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
from isotruss_ros.core.model.shapes import Disc
from isotruss_ros.core.safety.shape_guard import ShapeBounds
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
import numpy as np

#: Classes of recorded values by name; a text with any other name is refused.
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
    """Return a value as dictionaries, lists, texts and numbers with the names of its fields."""
    if type(value) in PLAIN:
        return value
    if isinstance(value, enum.Enum):
        return {'enum': type(value).__name__, 'name': value.name}
    if isinstance(value, np.ndarray):
        return {'array': value.tolist()}
    if isinstance(value, np.generic):
        return value.item()
    if hasattr(value, '_asdict'):
        named = value._asdict()
    elif is_dataclass(value):
        named = {field.name: getattr(value, field.name) for field in fields(value) if field.init}
    elif isinstance(value, Mapping):
        return {'mapping': {str(name): encode(part) for name, part in value.items()}}
    elif isinstance(value, Set):
        return sorted(map(encode, value))
    elif isinstance(value, tuple | list):
        return [encode(part) for part in value]
    else:  # a class of the user: refused when it is read
        return {'kind': type(value).__name__}
    return {'kind': type(value).__name__} | {name: encode(part) for name, part in named.items()}


def decode(value: Any) -> Any:
    """Return the value of a text's part; raise RecordedCycleError unless it is of known form."""
    if isinstance(value, list):
        return tuple(decode(part) for part in value)
    if not isinstance(value, dict):
        return value
    try:
        if 'array' in value:
            return np.array(value['array'], dtype=float)
        if 'mapping' in value:
            return {name: decode(part) for name, part in value['mapping'].items()}
        if 'enum' in value:
            return ENUMS[value['enum']][value['name']]
        kind = value['kind']
        return KINDS[kind](**{n: decode(part) for n, part in value.items() if n != 'kind'})
    except KeyError as error:
        raise RecordedCycleError(f'{error.args[0]!r}: no known class or value') from error
    except (TypeError, ValueError, AttributeError) as error:
        raise RecordedCycleError(str(error)) from error


def flatten(value: Any, name: str = '') -> dict[str, Any]:
    """Return the numbers and texts in a value by their names, such as `squeeze.force`."""
    parts: Mapping[str, Any]
    if isinstance(value, dict):
        parts = {n: part for n, part in value.items() if n not in ('kind', 'enum')}
    elif isinstance(value, Sequence) and any(isinstance(part, dict | list) for part in value):
        parts = dict(zip(map(str, range(len(value))), value, strict=True))
    else:
        return {name: value}
    nested = [flatten(part, f'{name}.{n}' if name else n) for n, part in parts.items()]
    return {n: plain for part in nested for n, plain in part.items()}


def find_changes(before: ServoSettings, after: ServoSettings) -> list[str]:
    """Return a text such as `squeeze.force: 30.0 -> 40.0` for each setting that differs."""
    old, new = flatten(encode(before)), flatten(encode(after))
    return [
        f'{name}: {old.get(name)} -> {new.get(name)}'
        for name in old | new
        if old.get(name) != new.get(name)
    ]
