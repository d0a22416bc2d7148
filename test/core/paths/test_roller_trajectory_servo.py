# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The roller path servo: arrives, or gives up with the reason, and never runs away."""

from dataclasses import replace

from grips import disc_grip
from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core import load_robot, RigidObject, RollerFaults, RollingGrip, SimulatedRobot
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.inputs import (
    InputError,
    InputFault,
    LatestInputs,
    RejectedInput,
    RollerState,
    StampedInput,
)
from isotruss_ros.core.paths.roller_trajectory import (
    MAX_LAG,
    MAX_TIME_STEP,
    PROGRESS_TIMEOUT,
    REST_TIME,
    RollerTrajectory,
    RollerTrajectoryServo,
    START_TOLERANCE,
    TOLERANCE,
    Tolerance,
    TrajectoryTolerances,
)
from isotruss_ros.core.planning.grasp_plan import path_times
import numpy as np
import pytest
from robots import examples, generators

ROBOT = load_robot('nine_member')
N = len(ROBOT.roller_names)
MAX_SPEED = ROBOT.description.max_speed
PERIOD, TIMEOUT = 0.01, 0.2
PERFECT = RollerFaults()
GRASP = disc_grip(ROBOT.home, 'north/Z')
WAY = np.array([[0.0] * N, [0.02, -0.01, 0, 0.03, 0.01, -0.02], [0, 0.02, 0.01, 0, 0, 0]])
TIMES = np.array([0.0, 0.5, 1.1])
PATH = RollerTrajectory(ROBOT, WAY, TIMES)


class Run:
    """A simulated robot whose rollers follow a path; measurements are some cycles late."""

    def __init__(self, faults=PERFECT, seed=0, late=0, begin=None):
        config = ROBOT.home if begin is None else ROBOT.configuration(begin)
        thing = RigidObject(RollingGrip.attach(ROBOT.home, GRASP))
        self.robot = SimulatedRobot(config, thing, faults, seed)
        self.servo = RollerTrajectoryServo(ROBOT, TIMEOUT, LatestInputs())
        self.now, self.commands, self.places = 100.0, [], []
        self._late = [self.state()] * (late + 1)
        self.measure()

    def state(self):
        """Return the present input of the encoders."""
        return StampedInput(
            RollerState(self.robot.roller_positions.copy(), self.robot.roller_velocities.copy()),
            self.now,
        )

    def measure(self):
        """Pass the servo the latest late measurement."""
        self._late = [*self._late[1:], self.state()]
        self.servo.inputs.rollers = self._late[0]

    def cycle(self, period=PERIOD):
        """Advance by one cycle; return the step of the servo."""
        step = self.servo.decide(self.now)
        self.commands.append(step.speeds)
        self.robot.command(step.speeds)
        self.robot.advance(period)
        self.now += period
        self.places.append(self.robot.roller_positions)
        self.measure()
        return step

    def follow(self, path=PATH, longest=60.0, tolerances=None):
        """Follow a path to its end; return the last step."""
        self.servo.begin(path, self.now, tolerances=tolerances)
        for _ in range(round(longest / PERIOD)):
            step = self.cycle()
            if step.ended:
                assert self.servo.trajectory is None
                assert not step.speeds.any()
                return step
        raise AssertionError(f'not at its end after {longest} s')

    def away(self, path=PATH):
        """Return how far the furthest roller is from the end of a path [m]."""
        return np.abs(self.robot.roller_positions - path.at(path.duration).positions).max()


def check_speeds(commands):
    """Check that commands are finite and within the speed limit."""
    assert np.isfinite(commands).all()
    assert np.abs(commands).max() <= MAX_SPEED


def test_arrives_under_an_estimate_that_moves_by_more_than_the_tolerance():
    run, rng = Run(), np.random.default_rng(0)
    encoders = run.state
    offset = 0.0

    def estimated():
        nonlocal offset
        offset = 0.005 + rng.normal(scale=10.0 * TOLERANCE, size=N)
        reading = encoders()
        state = RollerState(reading.value.positions + offset, reading.value.velocities, offset)
        return StampedInput(state, reading.time)

    run.state = estimated
    assert run.follow().failure == ''
    end = PATH.at(PATH.duration).positions
    assert run.robot.roller_positions + 0.005 == pytest.approx(end, abs=50.0 * TOLERANCE)


def test_rollers_follow_positions_at_the_planned_times():
    run = Run()
    run.follow()
    # The last 20 um of the way are made good at 5 / s.
    assert len(run.places) * PERIOD == pytest.approx(PATH.duration, abs=0.5)
    for number, place in enumerate(run.places[: round(PATH.duration / PERIOD)]):
        wanted = PATH.at((number + 1) * PERIOD).positions
        assert place == pytest.approx(wanted, abs=MAX_SPEED * PERIOD)


@pytest.mark.parametrize('longest', [0.03, 0.1, 0.15])
def test_duration_is_independent_of_late_cycles(longest):
    rng = np.random.default_rng(0)
    run = Run()
    run.servo.begin(PATH, run.now)
    step = run.cycle()
    while not step.ended:
        step = run.cycle(rng.uniform(0.002, longest))
    assert step.failure == ''
    assert run.away() <= TOLERANCE
    assert PATH.duration < run.now - 100.0 < PATH.duration + 1.5 + REST_TIME
    check_speeds(run.commands)


def test_missed_cycles_are_not_caught_up():
    run = Run()
    run.servo.timeout = 10.0
    run.servo.begin(PATH, run.now)
    for _ in range(20):
        run.cycle()
    before, held = run.servo.time, run.robot.roller_positions
    run.now += 5.0
    run.measure()
    run.cycle()
    assert before < run.servo.time <= before + MAX_TIME_STEP
    assert np.abs(run.robot.roller_positions - held).max() < 3 * MAX_SPEED * PERIOD
    while run.servo.trajectory is not None:
        run.cycle()
    assert run.away() <= TOLERANCE


def test_a_clock_that_stands_or_runs_back_moves_the_path_no_further():
    run = Run()
    run.servo.begin(PATH, run.now)
    for _ in range(20):
        run.cycle()
    time = run.servo.time
    for back in (PERIOD, PERIOD, 0.05, 0.1):
        run.servo.inputs.rollers = run.servo.inputs.rollers._replace(time=run.now - back)
        step = run.servo.decide(run.now - back)
        assert not step.ended
        assert run.servo.time == time
        check_speeds(step.speeds)


@examples(25)
@given(generators())
def test_arrives_on_random_paths_from_near_their_beginning(rng):
    ways = rng.uniform(-0.02, 0.02, (rng.integers(0, 4), N))
    limits = replace(ROBOT.description, max_speed=rng.uniform(0.1, 1.0) * MAX_SPEED)
    points = np.vstack([np.zeros(N), np.cumsum(ways, axis=0)])
    times = path_times(points, limits, np.zeros(len(ways), dtype=bool))
    path = RollerTrajectory(ROBOT, points, times + rng.choice([0.0, 0.3]))
    begin = rng.uniform(-1.0, 1.0, N) * MAX_LAG
    faults, late = (
        (PERFECT, rng.integers(0, 8)),
        (RollerFaults(noise=0.01), 0),
        (RollerFaults(noise=0.002, slip=0.05), 1),
        (RollerFaults(slip=0.1), 0),
        (RollerFaults(speed_limit=0.02), 3),
    )[rng.integers(5)]
    run = Run(faults, late=late, begin=begin)
    assert run.follow(path).failure == ''
    assert run.away(path) <= TOLERANCE
    check_speeds(run.commands)


@pytest.mark.parametrize(('off', 'arrives'), [(4e-4, True), (6e-4, False)])
def test_rollers_with_coarse_encoders_arrive_near_the_end(off, arrives):
    path = RollerTrajectory(ROBOT, [[0.0] * N, [0.02] * N], [0.0, 1.0])
    run = Run()
    run.state = lambda: StampedInput(
        RollerState(path.at(run.now - 100.0).positions - off, np.zeros(N)), run.now
    )
    step = run.follow(path)
    assert (step.failure == '') == arrives
    assert run.now - 100.0 > 1.0 + PROGRESS_TIMEOUT


@pytest.mark.parametrize('stuck', ROBOT.roller_names)
@pytest.mark.parametrize('size', [1.0, 0.02])
def test_gives_up_on_a_stuck_roller_and_names_it(stuck, size):
    """The way of the rollers is far longer or far shorter than the largest lag."""
    way = size * 0.05 * np.linspace(0.9, 1.0, N) * (-1.0) ** np.arange(N)
    path = RollerTrajectory(ROBOT, [[0.0] * N, way], [0.0, max(size, 0.1)])
    assert (np.abs(way).max() > MAX_LAG) == (size == 1.0)
    run = Run(RollerFaults(stuck=frozenset({stuck})))
    step = run.follow(path)
    assert step.failure.startswith(f'roller {stuck} stays ')
    assert step.failure.endswith(' m behind the trajectory')
    assert run.now - 100.0 <= path.duration + PROGRESS_TIMEOUT + 5 * PERIOD
    # On the long way it waits from a tenth of a second on, where the lag is as large as it may be.
    assert run.now - 100.0 >= PROGRESS_TIMEOUT + (0.1 if size == 1.0 else 0.0)
    check_speeds(run.commands)
    # The others waited: none went on more than the stuck one may lag.
    others = np.delete(run.robot.roller_positions, ROBOT.roller_names.index(stuck))
    assert np.abs(others).max() < MAX_LAG + 3 * MAX_SPEED * PERIOD


def test_rollers_within_their_tolerance_of_speed_arrive():
    bounds = Tolerance(np.full(N, np.inf), np.full(N, 0.02))
    assert np.abs(PATH.at(0.25).velocities).max() > 0.05
    assert Run().follow(tolerances=TrajectoryTolerances(path=bounds)).failure == ''


def test_a_goal_time_replaces_the_progress_timeout_at_the_end():
    run = Run(RollerFaults(stuck=frozenset({ROBOT.roller_names[0]})))
    path = RollerTrajectory(ROBOT, [[0.0] * N, [0.2 * MAX_LAG] * N], [0.0, 0.1])
    step = run.follow(path, tolerances=TrajectoryTolerances(goal_time=2.0 * PROGRESS_TIMEOUT))
    assert step.at_goal
    assert run.now - 100.0 > path.duration + 2.0 * PROGRESS_TIMEOUT


def test_arrives_once_the_rollers_were_measured_at_rest_at_the_end():
    run = Run()
    run.servo.begin(RollerTrajectory(ROBOT, np.zeros((2, N)), [0.0, 0.05]), run.now)
    for _ in range(8):
        assert not run.cycle().ended
    late = run.now + REST_TIME
    assert not run.servo.decide(late).ended
    run.now = late
    run.measure()
    step = run.servo.decide(run.now)
    assert (step.ended, step.failure) == (True, '')


STATE = RollerState(np.zeros(N), np.zeros(N))


@pytest.mark.parametrize(
    ('rollers', 'fault', 'words'),
    [
        (None, InputFault.MISSING, 'joint states: none received yet'),
        (RejectedInput('joint states: nonsense'), InputFault.INVALID, 'joint states: nonsense'),
        (StampedInput(STATE, -1e9), InputFault.STALE, 'joint states: '),
        (StampedInput(STATE, 1e9), InputFault.INVALID, 'joint states: '),
    ],
)
def test_ends_at_rest_without_joint_states(rollers, fault, words):
    run = Run()
    run.servo.begin(PATH, run.now)
    run.cycle()  # begins at rest
    for _ in range(20):
        assert run.cycle().speeds.any()
    run.servo.inputs.rollers = rollers
    step = run.servo.decide(run.now)
    assert not step.ended
    assert not step.speeds.any()
    step = run.servo.decide(run.now + 1.01 * TIMEOUT)
    assert step.ended
    assert not step.speeds.any()
    assert step.failure.startswith(words)
    with pytest.raises(InputError, match=words) as refused:
        run.servo.begin(PATH, run.now)
    assert (refused.value.name, refused.value.fault) == ('joint_states', fault)
    run.measure()
    step = run.servo.decide(run.now)
    assert (step.ended, step.failure) == (True, 'the servo has no trajectory; start one first')


@pytest.mark.parametrize('roller', range(N))
@pytest.mark.parametrize('side', [-1.0, 1.0])
def test_a_trajectory_begins_only_at_the_rollers(roller, side):
    unit = side * START_TOLERANCE * (np.arange(N) == roller)
    near, far = Run(begin=0.99 * unit), Run(begin=1.01 * unit)
    near.servo.begin(PATH, near.now)
    name = ROBOT.roller_names[roller]
    with pytest.raises(ConfigurationError, match=f'position of roller {name}'):
        far.servo.begin(PATH, far.now)
    assert far.servo.trajectory is None


values = st.one_of(st.floats(-0.05, 0.05), st.floats(-1e6, 1e6), st.sampled_from([1e6, -1e6]))
states = st.lists(values, min_size=N, max_size=N)


@examples(100)
@given(generators(), st.lists(states, max_size=30))
def test_speeds_are_within_the_limit(rng, measured):
    run = Run()
    run.servo.begin(PATH, run.now)
    for positions in measured:
        state = RollerState(np.array(positions), np.zeros(N))
        for _ in range(rng.integers(1, 20)):
            run.servo.inputs.rollers = StampedInput(state, run.now)
            step = run.servo.decide(run.now)
            check_speeds(step.speeds)
            run.now += PERIOD
            if step.ended:
                assert not step.speeds.any()
                return
