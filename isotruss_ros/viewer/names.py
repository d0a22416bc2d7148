"""Names that the view shares with who serves it, without the packages that draw."""

from __future__ import annotations

from isotruss_ros.core import IsotrussError

#: What the handle drags, if no joint; requests that are no settings.
OBJECT, STOP, RELEASE = 'object', 'stop', 'release'
#: Requests that are goals.
PICK, PLACE = 'pick', 'place'
#: The request for another plant, and what can be chosen.
PLANT = 'plant'
KINEMATIC, ELASTIC, MUJOCO = PLANTS = ('kinematic', 'elastic', 'mujoco')
#: This machine only.
LOCAL = '127.0.0.1'


class MissingPackageError(IsotrussError, ImportError):
    """A package of the extra `viewer` is not installed."""

    def __init__(self, error: ImportError) -> None:
        super().__init__(f'{error}: install what the viewer needs: pip install viser mcap rosbags')
