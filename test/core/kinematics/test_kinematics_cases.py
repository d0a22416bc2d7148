# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Rare ends of placing modules; rows on nodes as rows on rollers."""

from isotruss_ros.core import load_robot
from isotruss_ros.core.errors import RobotFileError
from isotruss_ros.core.kinematics import home
import numpy as np
import pytest
import robots


@pytest.mark.parametrize('name', robots.PRESETS)
def test_rows_on_rollers_are_those_on_nodes_times_their_motion(name):
    config = load_robot(name).home
    rows = np.random.default_rng(0).standard_normal((5, 2 * len(config.points)))
    found = config.roller_rows(rows)
    assert found == pytest.approx(rows @ config.node_jacobian, abs=1e-9)
    driven = [config.robot.module_names.index(roller) for roller in config.robot.roller_names]
    assert config.module_rows(rows)[:, driven] == pytest.approx(found, abs=1e-9)


def test_modules_that_cannot_be_turned_are_refused(monkeypatch):
    def singular(matrix):
        raise np.linalg.LinAlgError

    document = robots.example()
    robots.load(document)
    monkeypatch.setattr(home, 'factorize', singular)
    with pytest.raises(RobotFileError, match='no angle of its rod bisects its sides'):
        robots.load(document)


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ((0.999, None), r'is .* m long at home, pinch to pinch; must be from min_length'),
        ((1.001, None), None),
        ((None, 1.001), r'must hold two of them; must be less than'),
        ((None, 0.999), None),
    ],
)
def test_members_are_as_long_as_they_may_be_and_hold_two_rings(change, message):
    """Against the longest member by its bound, and the shortest by the rings that it holds."""
    document = robots.example()
    lengths = robots.load(document).home.member_lengths
    longest, ring = change
    if longest is not None:
        document['members']['max_length'] = longest * float(lengths.max())
    if ring is not None:
        document['module']['guide_ring_distance'] = ring * 0.5 * float(lengths.min())
    if message is None:
        robots.load(document)
        return
    with pytest.raises(RobotFileError, match=message):
        robots.load(document)
