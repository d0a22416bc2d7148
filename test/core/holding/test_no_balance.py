# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Loads under which there is no equilibrium."""

from apart_grips import APART
from grips import gripped
from held_grips import BOX, held, HOME, numbers
from isotruss_ros.core import HoldStatus
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.roll_grip import roll_grip
import numpy as np
import pytest

DISC = attach_grip(*gripped(35.0, squeeze=0.08))


@pytest.mark.parametrize('grip', [DISC, held(BOX, 0.2)], ids=['disc', 'box'])
def test_there_is_no_equilibrium_under_any_load(grip):
    assert roll_grip(grip, grip.config, 1e6 * np.array([0.3, -0.8, 0.0])) is None


def test_a_box_that_is_pulled_away_has_no_balance():
    body = held(BOX, 0.2).body
    found = attach_grip(HOME, body, numbers(APART), np.array([0.0, 1e6, 0.0]))
    assert found is HoldStatus.NO_BALANCE
