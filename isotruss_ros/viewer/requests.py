# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Requests that a browser may send: settings with their bounds, and checks of values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import math
from numbers import Real

from isotruss_ros.core import IsotrussError
from isotruss_ros.core.errors import quote
from isotruss_ros.viewer.names import (
    CLEAR,
    DRAGGED,
    MOVED,
    OBJECT,
    OBJECTS,
    PICK,
    PLACE,
    PLACED,
    PLACING,
    PLANT,
    PLANTS,
    RELEASE,
    RESET,
    RESUME,
    SHAPE,
    TARGET,
    TURN,
)

#: Name of the initial plant or object in the lists of plants and objects.
INITIAL_CHOICE = 'as started'
#: Largest valid coordinate of a drag [m].
MAX_DRAG_DISTANCE = 100.0
BUTTONS = (RELEASE, RESUME, RESET, PICK, PLACE, PLACING, CLEAR)
#: Number of values before the points of each request with points [-].
POINTS = {PLACED: 0, TARGET: 1, TURN: 1, MOVED: 2}


class RequestError(IsotrussError, ValueError):
    """Error: a browser sent a value that its controls cannot send."""


@dataclass(frozen=True)
class Setting:
    """Setting that a slider changes."""

    name: str  #: name of the request
    label: str  #: displayed name
    bounds: tuple[float, float]  #: smallest and largest value
    step: float  #: step of the values


SETTINGS = (
    Setting('friction', 'friction', (0.05, 1.5), 0.05),
    Setting('diameter', 'diameter [m]', (0.05, 0.6), 0.01),
    Setting('squeeze', 'squeeze [N]', (0.0, 60.0), 1.0),
)
WRENCH = (
    Setting('fx', 'force x [N]', (-20.0, 20.0), 0.5),
    Setting('fy', 'force y [N]', (-20.0, 20.0), 0.5),
    Setting('m', 'moment [N m]', (-2.0, 2.0), 0.05),
)
BOUNDS = {setting.name: setting.bounds for setting in (*SETTINGS, *WRENCH)}


def check_request(name: str, value: object, choices: Mapping[str, Sequence[str]]) -> None:
    """Raise RequestError if a request has a value that its slider or list cannot send."""
    if name in BOUNDS:
        low, high = BOUNDS[name]
        if not (_is_finite(value) and low <= value <= high):  # type: ignore[operator]
            _refuse(name, value, f'from {low:g} to {high:g}')
    elif name in choices:
        if value not in choices[name]:
            _refuse(name, value, f'one of {", ".join(choices[name])}')
    elif name in POINTS:
        first = POINTS[name]
        for place in value[first:]:  # type: ignore[index]
            if len(place) != 2 or not all(
                _is_finite(x) and abs(x) <= MAX_DRAG_DISTANCE for x in place
            ):
                _refuse(name, value, f'two coordinates of at most {MAX_DRAG_DISTANCE:g} m')
    elif name not in BUTTONS:
        _refuse(name, value, 'a request of the page')


def list_choices(joints: Sequence[str]) -> dict[str, Sequence[str]]:
    """Return the list of admissible values of each request with choices, by the request's name."""
    return {
        DRAGGED: (OBJECT, *joints),
        SHAPE: (INITIAL_CHOICE, *OBJECTS),
        PLANT: (INITIAL_CHOICE, *PLANTS),
    }


def _is_finite(value: object) -> bool:
    return isinstance(value, Real) and math.isfinite(value)


def _refuse(name: str, value: object, right: str) -> None:
    raise RequestError(f'{name}: {quote(str(value))} from a browser: must be {right}')
