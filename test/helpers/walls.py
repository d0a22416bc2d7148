# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Limits that a test makes up."""

from isotruss_ros.core import Status
from isotruss_ros.core.manipulation.limits import Rows
import numpy as np


class Wall:
    """Rows on the roller speeds, each with a bound on one side."""

    status = Status.SLOWED_SELF_COLLISION
    can_slide = True

    def __init__(self, matrix, bound):
        self.matrix, self.bound = matrix, bound

    def rows(self, config):
        return Rows(self.matrix, -self.bound, np.full(len(self.bound), np.inf))

    def row_names(self, config):
        return tuple(f'wall {i}' for i in range(len(self.bound)))
