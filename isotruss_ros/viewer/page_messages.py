# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages of viser's protocol that the page of a view sends."""

from __future__ import annotations

import math

from isotruss_ros.core.errors import quote
from isotruss_ros.viewer.requests import RequestError
from viser import _messages

#: Types of the messages, in viser's protocol.
KINDS = (
    _messages.GuiUpdateMessage,
    _messages.LocalStorageGetItemResponseMessage,
    _messages.SceneNodeDragMessage,
    _messages.ScenePointerMessage,
    _messages.ViewerCameraMessage,
)
#: Vectors of a camera, with their numbers of components.
CAMERA_VECTORS = {'position': 3, 'look_at': 3, 'up_direction': 3, 'wxyz': 4}


def check_message(packed: str | bytes) -> None:
    """Raise RequestError if a message is not one that the page of a view sends."""
    if not isinstance(packed, bytes):
        raise RequestError('text: must be binary')
    try:
        message = _messages.Message.deserialize(packed)
    except Exception as error:
        raise RequestError(quote(repr(error))) from error
    if not isinstance(message, KINDS):
        raise RequestError(f'{type(message).__name__}: must be a message of this page')
    if isinstance(message, _messages.GuiUpdateMessage):
        if not isinstance(message.updates, dict) or set(message.updates) != {'value'}:
            raise RequestError('GuiUpdateMessage: must update a value, and nothing else')
    elif isinstance(message, _messages.ViewerCameraMessage):
        for name, size in CAMERA_VECTORS.items():
            if not _is_vector(getattr(message, name), size):
                raise RequestError(f'ViewerCameraMessage: {name} must have {size} finite numbers')
        if not _is_vector((message.image_width, message.image_height), 2):
            raise RequestError('ViewerCameraMessage: width and height must be finite')
    elif isinstance(message, _messages.ScenePointerMessage):
        ray = message.ray_origin, message.ray_direction
        if message.event_type != 'click' or not all(_is_vector(part, 3) for part in ray):
            raise RequestError(
                'ScenePointerMessage: must be a click, with a ray of finite numbers'
            )
        if not isinstance(message.screen_pos, list | tuple) or len(message.screen_pos) != 1:
            raise RequestError('ScenePointerMessage: screen_pos must have one point')


def _is_vector(values: object, size: int) -> bool:
    """Return whether a value is a vector of finite numbers."""
    return (
        isinstance(values, list | tuple)
        and len(values) == size
        and all(isinstance(value, int | float) and math.isfinite(value) for value in values)
    )
