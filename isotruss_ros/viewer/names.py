# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Names that the view shares with who serves it, without the packages that draw."""

from __future__ import annotations

from isotruss_ros.core import IsotrussError

#: What the handle drags, if no joint; requests that are no settings.
OBJECT, STOP, RELEASE = 'object', 'stop', 'release'
#: Requests that are goals.
PICK, PLACE = 'pick', 'place'
#: Requests to drag something else, to drag it somewhere, and to turn it.
DRAGGED, TARGET, TURN = 'dragged', 'target', 'turn'
#: The request to begin anew.
RESET = 'reset'
#: The request for another plant, and what can be chosen.
PLANT = 'plant'
KINEMATIC, ELASTIC, MUJOCO = PLANTS = ('kinematic', 'elastic', 'mujoco')
#: This machine only.
LOCAL = '127.0.0.1'


class MissingPackageError(IsotrussError, ImportError):
    """A package of the extra `viewer` is not installed."""

    def __init__(self, error: ImportError) -> None:
        super().__init__(
            f'{error}: install what the viewer needs, in the environment of this Python: '
            'pip install viser mcap rosbags'
        )
