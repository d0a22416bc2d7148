# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""ContactPoints are sent, squeezed and judged: the answer is that of squeezing here."""

import functools
import pickle

import closings
from isotruss_ros.core import ConvexObject, GraspRequirements, load_robot
from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.planning import grasp_candidate as candidates
from isotruss_ros.core.planning.approach import approach
from isotruss_ros.core.planning.closing_in_place import ClosingInPlace
from isotruss_ros.core.planning.grasp_candidate import make_grasp_candidate, squeeze_candidate
from isotruss_ros.core.planning.grasp_plan import Violation
from isotruss_ros.core.planning.requirements import Measure, rate_grasp
from isotruss_ros.core.planning.seeds import find_seeds
from isotruss_ros.core.planning.squeeze import Squeeze
import numpy as np
import pytest

BODY = ConvexObject.disc((0.716, 0.5), 0.4)
DIRECTION = (1.0, 2.0, 0.5)


@functools.lru_cache(maxsize=2)
def opened():
    """Return an open grip that can be squeezed."""
    home = load_robot('triangle').home
    needs = GraspRequirements(module='main/T')
    reached = approach(home, find_seeds(home, BODY, needs, 0, 0)[0])
    assert reached.unmet is None
    return reached


def sent(needs):
    """Return a candidate that came from another process, as far as it can tell."""
    return pickle.loads(pickle.dumps(make_grasp_candidate(opened(), needs)))


@functools.lru_cache(maxsize=2)
def squeezed():
    """Return what became of a candidate that was sent, and sent back."""
    return pickle.loads(pickle.dumps(squeeze_candidate(sent(GraspRequirements()))))


def test_what_was_sent_is_squeezed_as_here():
    needs, there, start = GraspRequirements(), squeezed(), opened().path[-1]
    search = ClosingInPlace(start, opened().closing, needs)
    closed = search.close()
    assert there.violation is None
    assert (there.grip.path == closed.path).all()
    assert (there.grip.points == closed.points).all()
    assert (there.grip.body, there.grip.squeeze) == (closed.body, closed.squeeze)
    assert there.grip.slip_margin == closed.slip_margin > 0.0
    assert (there.evaluations, there.analyses) == (search.evaluations, search.analyses)
    assert (there.grip.analysis.normal_forces == closed.analysis.normal_forces).all()


def test_rows_go_from_the_touch_to_the_grasp_and_rigidity_is_the_least_of_them():
    there, robot = squeezed().grip, load_robot('triangle')
    configs = [opened().path[-1].moved_to(row) for row in there.path]
    sides = list(opened().closing.members)
    gaps = np.array([closings.gaps(config, BODY)[0][sides] for config in configs])
    assert gaps[0] == pytest.approx(0.0, abs=1e-5)
    assert (np.diff(gaps.mean(axis=1)) < 0.0).all()
    assert configs[-1].points == pytest.approx(there.points)
    rigidities = [closings.rigidity(config) for config in configs]
    assert there.rigidity == pytest.approx(min(rigidities), rel=1e-3)
    assert np.ptp(rigidities) > 2e-3 * max(rigidities)
    assert len(there.points) == len(robot.node_names)


def test_what_is_no_grasp_says_what_it_misses_and_what_it_took():
    needs = GraspRequirements(max_total_force=1e-3)
    there = squeeze_candidate(sent(needs))
    search = ClosingInPlace(opened().path[-1], opened().closing, needs)
    assert search.close() is None
    assert there.grip is None
    assert (there.violation.requirement, there.violation.bound) == ('max_total_force', 1e-3)
    assert there.violation.value == search.closest_violation.value
    assert (there.evaluations, there.analyses) == (search.evaluations, search.analyses)


@pytest.mark.parametrize('known', [None, Violation('min_margin', 0.1, 0.2, 0.5)])
def test_what_cannot_be_computed_is_no_grasp_and_ends_nothing(known, monkeypatch):
    def close(self):
        self._motion.closest_violation, self.analyses = known, 3
        raise SolverError('no solver found anything')

    monkeypatch.setattr(ClosingInPlace, 'close', close)
    there = squeeze_candidate(sent(GraspRequirements()))
    assert there.grip is None
    assert there.analyses == 3
    # What was found out before is still the nearest.
    expected = known or Violation('no solver found anything', 0.0, 0.0, 0.0)
    for name in ('requirement', 'value', 'bound'):
        assert getattr(there.violation, name) == getattr(expected, name)


def test_a_grasp_without_a_path_is_none(monkeypatch):
    monkeypatch.setattr(ClosingInPlace, 'close', lambda self: None)
    there = squeeze_candidate(sent(GraspRequirements()))
    assert there.grip is None
    violation = there.violation
    assert (violation.requirement, violation.value, violation.bound) == ('path', 0.0, 1.0)


def test_an_object_that_the_ground_holds_is_pressed_on_as_it_lies():
    needs = GraspRequirements(min_margin=0.0)
    assert not needs.object_is_free
    there = squeeze_candidate(sent(needs)).grip
    closed = Squeeze(opened().path[-1], opened().closing, needs).close()
    assert (there.path == closed.path).all()
    assert there.squeeze == pytest.approx(there.analysis.normal_forces.sum() / 2.0)
    assert there.analysis.force_closure
    assert there.body == BODY


def test_other_errors_are_not_hidden(monkeypatch):
    def close(self):
        raise ZeroDivisionError

    monkeypatch.setattr(ClosingInPlace, 'close', close)
    with pytest.raises(ZeroDivisionError):
        squeeze_candidate(sent(GraspRequirements()))


def test_scores_are_those_of_the_measure():
    there = squeezed().grip
    # Along the unit vector of the direction, by hand.
    x, y, turn = np.array(DIRECTION) / np.sqrt(1.0 + 4.0 + 0.25)
    k = there.analysis.stiffness
    stiffness = x * x * k[0, 0] + y * y * k[1, 1] + turn * turn * k[2, 2]
    stiffness += 2.0 * (x * y * k[0, 1] + x * turn * k[0, 2] + y * turn * k[1, 2])
    expected = {
        Measure.TRAVEL: -0.7,
        Measure.TOTAL_FORCE: -31.0,
        Measure.CLOSURE_MARGIN: there.analysis.closure_margin,
        Measure.SLIP_MARGIN: 2.5,
        Measure.STIFFNESS: stiffness,
    }
    for measure in Measure:
        needs = GraspRequirements(measure=measure, direction=DIRECTION)
        score = rate_grasp(needs, there.analysis, 31.0, 2.5, -0.7)
        assert score == pytest.approx(expected[measure])


def test_robots_are_made_once_in_a_process():
    one, other = sent(GraspRequirements()), sent(GraspRequirements())
    assert candidates._robot(one.robot) is candidates._robot(other.robot)
    assert candidates._robot(one.robot) is not opened().path[0].robot
    assert candidates._robot(one.robot).description == opened().path[0].robot.description
