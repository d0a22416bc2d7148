# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

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
