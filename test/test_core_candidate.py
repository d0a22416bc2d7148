"""Candidates are sent, squeezed and judged: the answer is that of squeezing here."""

import functools
import pickle

import closings
from isotruss_ros.core import candidate as candidates
from isotruss_ros.core import Cylinder, GraspRequirements, load_robot, Measure, SolverError
from isotruss_ros.core.approach import approach
from isotruss_ros.core.branches import branches
from isotruss_ros.core.candidate import make_candidate, squeeze_candidate
from isotruss_ros.core.grasp_plan import Miss
from isotruss_ros.core.squeeze import Squeeze
import numpy as np
import pytest

CYLINDER = Cylinder((0.51, 0.35), 0.4)
DIRECTION = (1.0, 2.0, 0.5)


@functools.lru_cache(maxsize=2)
def opened():
    """Return an open grip that can be squeezed."""
    home = load_robot('triangle').home
    needs = GraspRequirements(module='main/T')
    reached = approach(home, branches(home, CYLINDER, needs, 0, 0)[0])
    assert reached.missed is None
    return reached


def sent(needs):
    """Return a candidate that came from another process, as far as it can tell."""
    return pickle.loads(pickle.dumps(make_candidate(opened(), needs)))


@functools.lru_cache(maxsize=2)
def squeezed():
    """Return what became of a candidate that was sent, and sent back."""
    return pickle.loads(pickle.dumps(squeeze_candidate(sent(GraspRequirements()))))


def test_what_was_sent_is_squeezed_as_here():
    needs, there, start = GraspRequirements(), squeezed(), opened().path[-1]
    search = Squeeze(start, opened().closing, needs)
    pressed = search.search()
    way = search.way(pressed)
    assert there.miss is None
    assert (there.positions == np.array([config.roller_positions for config in way])).all()
    assert (there.points == pressed.config.points).all()
    assert (there.looked_at, there.analysed) == (search.looked_at, search.analyses)
    for one, other in zip(there.analyses, pressed.analyses, strict=True):
        assert (one.normal_forces == other.normal_forces).all()


def test_rows_go_from_the_touch_to_the_grasp_and_rigidity_is_the_least_of_them():
    there, robot = squeezed(), load_robot('triangle')
    configs = [opened().path[-1].moved_to(row) for row in there.positions]
    sides = list(opened().closing.sides)
    gaps = np.array([closings.gaps(config, CYLINDER)[0][sides] for config in configs])
    assert gaps[0] == pytest.approx(0.0, abs=1e-5)
    assert (np.diff(gaps, axis=0) < 0.0).all()
    assert configs[-1].points == pytest.approx(there.points)
    rigidities = [closings.rigidity(config) for config in configs]
    assert there.rigidity == pytest.approx(min(rigidities), rel=1e-3)
    assert np.ptp(rigidities) > 2e-3 * max(rigidities)
    assert len(there.points) == len(robot.node_names)


def test_what_is_no_grasp_says_what_it_misses_and_what_it_took():
    needs = GraspRequirements(max_total_force=1e-3)
    there = squeeze_candidate(sent(needs))
    search = Squeeze(opened().path[-1], opened().closing, needs)
    assert search.search() is None
    assert there.positions.shape == (0, 2)
    assert there.analyses == ()
    assert (there.miss.requirement, there.miss.bound) == ('max_total_force', 1e-3)
    assert there.miss.value == search.nearest.value
    assert (there.looked_at, there.analysed) == (search.looked_at, search.analyses)


@pytest.mark.parametrize('known', [None, Miss('min_margin', 0.1, 0.2, 0.5)])
def test_what_cannot_be_computed_is_no_grasp_and_ends_nothing(known, monkeypatch):
    def search(self):
        self.nearest, self.analyses = known, 3
        raise SolverError('no solver found anything')

    monkeypatch.setattr(Squeeze, 'search', search)
    there = squeeze_candidate(sent(GraspRequirements()))
    assert len(there.positions) == len(there.analyses) == 0
    assert there.analysed == 3
    # What was found out before is still the nearest.
    assert there.miss.requirement == (known.requirement if known else 'no solver found anything')


def test_a_grasp_without_a_way_is_none(monkeypatch):
    monkeypatch.setattr(Squeeze, 'way', lambda self, pressed: ())
    # None of its analyses missed anything.
    monkeypatch.setattr(Squeeze, '_note', lambda self, miss: None)
    there = squeeze_candidate(sent(GraspRequirements()))
    assert len(there.positions) == len(there.analyses) == 0
    assert there.miss.requirement == 'path'


def test_other_errors_are_not_hidden(monkeypatch):
    def search(self):
        raise ZeroDivisionError

    monkeypatch.setattr(Squeeze, 'search', search)
    with pytest.raises(ZeroDivisionError):
        squeeze_candidate(sent(GraspRequirements()))


def test_scores_are_those_of_the_worst_spacing():
    there = squeezed()
    total = [one.normal_forces.sum() for one in there.analyses]
    margin = [one.closure_margin for one in there.analyses]
    # Along the unit vector of the direction, by hand.
    x, y, turn = np.array(DIRECTION) / np.sqrt(1.0 + 4.0 + 0.25)
    stiffness = [
        x * x * k[0, 0]
        + y * y * k[1, 1]
        + turn * turn * k[2, 2]
        + 2.0 * (x * y * k[0, 1] + x * turn * k[0, 2] + y * turn * k[1, 2])
        for k in (one.stiffness for one in there.analyses)
    ]
    assert len(set(total)) == len(set(margin)) == len(set(stiffness)) == 3
    expected = {
        Measure.TRAVEL: -0.7,
        Measure.TOTAL_FORCE: -max(total),
        Measure.CLOSURE_MARGIN: min(margin),
        Measure.STIFFNESS: min(stiffness),
    }
    for measure in Measure:
        needs = GraspRequirements(measure=measure, direction=DIRECTION)
        assert there.score(needs, 0.7) == pytest.approx(expected[measure])


def test_robots_are_made_once_in_a_process():
    one, other = sent(GraspRequirements()), sent(GraspRequirements())
    assert candidates._robot(one.robot) is candidates._robot(other.robot)
    assert candidates._robot(one.robot) is not opened().path[0].robot
    assert candidates._robot(one.robot).description == opened().path[0].robot.description
