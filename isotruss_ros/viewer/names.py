# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names shared by the view and its owner, without dependencies for drawing."""

from __future__ import annotations

from isotruss_ros.core import IsotrussError

#: Name of the dragged object; requests that are no settings.
OBJECT, STOP, RELEASE = 'object', 'stop', 'release'
#: Requests that are goals.
PICK, PLACE = 'pick', 'place'
#: Requests to select the dragged part, to drag it and to rotate it.
DRAGGED, TARGET, TURN = 'dragged', 'target', 'turn'
#: The request of a reset.
RESET = 'reset'
#: The request of another plant, and the choices.
PLANT = 'plant'
KINEMATIC, ELASTIC, MUJOCO = PLANTS = ('kinematic', 'elastic', 'mujoco')
#: The request for another object, and the parameter `object` of what can be chosen.
SHAPE = 'shape'
OBJECTS = {
    'disc': '',
    'box': '{shape: polygon, corner_radius: 0.03, '
    'vertices: [[-0.15, -0.12], [0.15, -0.12], [0.15, 0.12], [-0.15, 0.12]]}',
    'ellipse': '{shape: ellipse, semi_axes: [0.17, 0.13]}',
}
#: This machine only.
LOCAL = '127.0.0.1'


class MissingPackageError(IsotrussError, ImportError):
    """A package of the extra `viewer` is not installed."""

    def __init__(self, error: ImportError) -> None:
        super().__init__(
            f'{error}: install what the viewer needs, in the environment of this Python: '
            'pip install viser mcap rosbags'
        )
