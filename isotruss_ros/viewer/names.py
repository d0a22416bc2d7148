# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names shared by the view and its owner; no import of drawing packages."""

from __future__ import annotations

from isotruss_ros.core import IsotrussError

#: Name of the dragged object, and requests that are not settings.
OBJECT, STOP, RELEASE = 'object', 'stop', 'release'
#: Requests for goals.
PICK, PLACE = 'pick', 'place'
#: Requests to select the dragged part, to translate it and to rotate it.
DRAGGED, TARGET, TURN = 'dragged', 'target', 'turn'
#: Request for a reset.
RESET = 'reset'
#: Request for another plant.
PLANT = 'plant'
KINEMATIC, ELASTIC, MUJOCO = PLANTS = ('kinematic', 'elastic', 'mujoco')
#: Request for another object.
SHAPE = 'shape'
OBJECTS = {
    'disc': '',
    'box': '{shape: polygon, corner_radius: 0.03, '
    'vertices: [[-0.15, -0.12], [0.15, -0.12], [0.15, 0.12], [-0.15, 0.12]]}',
    'ellipse': '{shape: ellipse, semi_axes: [0.17, 0.13]}',
}
#: Address that only this machine can reach.
LOCAL = '127.0.0.1'


class MissingPackageError(IsotrussError, ImportError):
    """A package of the extra `viewer` is not installed."""

    def __init__(self, error: ImportError) -> None:
        super().__init__(
            f'{error}: install what the viewer needs, in the environment of this Python: '
            'pip install viser mcap rosbags'
        )
