# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The Gymnasium environment of a held object."""

import math
import sys
import warnings

from isotruss_ros.core import Ellipse, HoldStatus, Pose
from isotruss_ros.core.errors import GraspError, IsotrussError
from isotruss_ros.extras import MissingPackageError
import numpy as np
import pytest

try:
    import gymnasium
    from gymnasium.utils.env_checker import check_env
    from isotruss_ros.learning import ENVIRONMENT, HeldObjectEnv, progress_reward, Transition
except ModuleNotFoundError:
    gymnasium = None

pytestmark = pytest.mark.skipif(gymnasium is None, reason='needs the extra learning')
TRIANGLE = {'robot': 'triangle', 'members': ('main/R-T', 'main/T-L'), 'force': 0.5}


def episode(env, seed, count=10):
    """Return the observations and rewards of random actions."""
    observation, _ = env.reset(seed=seed)
    env.action_space.seed(seed)
    rows = [observation]
    rewards = []
    for _ in range(count):
        observation, reward, *_ = env.step(env.action_space.sample())
        rows.append(observation)
        rewards.append(reward)
    return np.array(rows), rewards


@pytest.fixture
def vector():
    return gymnasium.make_vec(
        ENVIRONMENT, num_envs=3, vectorization_mode='vector_entry_point', max_episode_steps=3
    )


@pytest.fixture(scope='module')
def env():
    return gymnasium.make(ENVIRONMENT)


@pytest.mark.parametrize('arguments', [{}, {**TRIANGLE, 'shape': Ellipse((0.16, 0.15))}])
def test_gymnasium_finds_no_fault(arguments):
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        warnings.simplefilter('ignore', DeprecationWarning)  # of Matplotlib's fonts
        check_env(gymnasium.make(ENVIRONMENT, **arguments).unwrapped)


def test_the_registered_name_needs_no_import_beyond_gymnasium():
    made = gymnasium.make(f'isotruss_ros.learning:{ENVIRONMENT}')
    assert isinstance(made.unwrapped, HeldObjectEnv)


def test_episodes_of_the_same_seed_are_equal(env):
    observations, rewards = episode(env, 5)
    repeated, same = episode(env, 5)
    assert (observations == repeated).all()
    assert rewards == same
    other, _ = episode(env, 6)
    assert (other[0] != observations[0]).any()


def test_observation_has_pose_goal_and_roller_travel(env):
    goal = (0.72, 0.76, 0.1)
    observation, info = env.reset(seed=0, options={'goal': goal})
    pose = observation[:3]
    assert observation[3:6] == pytest.approx(np.subtract(goal, pose), abs=1e-6)
    assert info['distance'] == pytest.approx(math.hypot(*observation[3:5]), abs=1e-6)
    assert observation[6:] == pytest.approx(np.zeros(6))
    moved, *_ = env.step(np.array([0.0, 0.02, 0.0], dtype=np.float32))
    assert moved[1] - observation[1] == pytest.approx(0.02 * 0.05, rel=0.05)
    assert moved[4] - observation[4] == pytest.approx(-0.02 * 0.05, rel=0.05)
    assert np.abs(moved[6:]).max() > 1e-4


def test_twist_toward_the_goal_carries_the_object_there(env):
    observation, info = env.reset(seed=3)
    for _ in range(100):
        action = np.append(observation[3:5], 0.0).astype(np.float32)
        observation, _, lost, _, info = env.step(action)
        assert not lost
        assert info['slip_margin'] > 0.0
    assert info['distance'] < 0.001


def test_an_episode_ends_when_the_object_is_lost_with_the_reason(env):
    env.reset(seed=0, options={'external_wrench': (0.0, -80.0, 0.0)})
    _, reward, terminated, truncated, info = env.step(np.zeros(3, dtype=np.float32))
    assert (terminated, truncated) == (True, False)
    assert info['reason'] in {hold.value for hold in HoldStatus if hold is not HoldStatus.HELD}
    assert info['status'] == 'halt not held'
    assert info['squeeze'] == 0.0
    assert reward < -0.1
    with pytest.raises(gymnasium.error.ResetNeeded, match='must be begun by reset'):
        env.unwrapped.step(np.zeros(3, dtype=np.float32))
    env.reset(seed=0)
    assert not env.step(np.zeros(3, dtype=np.float32))[2]


def test_vector_environment_of_gymnasium_steps_each_as_alone(env):
    vector = gymnasium.make_vec(ENVIRONMENT, num_envs=2, vectorization_mode='sync')
    starts, _ = vector.reset(seed=5)  # the seeds are 5 and 6
    actions = np.array([[0.01, 0.0, 0.0], [0.0, 0.01, 0.05]], dtype=np.float32)
    ends, rewards, terminated, _, _ = vector.step(actions)
    assert not terminated.any()
    for i, seed in enumerate((5, 6)):
        observation, _ = env.reset(seed=seed)
        assert (observation == starts[i]).all()
        observation, reward, *_ = env.step(actions[i])
        assert (observation == ends[i]).all()
        assert reward == rewards[i]


def test_own_vector_environment_steps_each_as_alone(env, vector):
    starts, _ = vector.reset(seed=5)
    rng = np.random.default_rng(0)
    actions = rng.uniform(-0.02, 0.02, (3, 3, 3)).astype(np.float32)
    steps = [vector.step(each) for each in actions]
    for i in range(3):
        observation, _ = env.reset(seed=5 + i)
        assert observation == pytest.approx(starts[i], abs=1e-9)
        for action, (observations, rewards, lost, _, info) in zip(actions, steps, strict=True):
            observation, reward, terminated, _, alone = env.step(action[i])
            assert observation == pytest.approx(observations[i], abs=1e-9)
            assert reward == pytest.approx(rewards[i], abs=1e-9)
            assert lost[i] == terminated
            assert info['slip_margin'][i] == pytest.approx(alone['slip_margin'], abs=1e-9)


def test_own_vector_environment_resets_in_the_step_after_an_episode(vector):
    vector.reset(seed=0)
    still = np.zeros((3, 3), dtype=np.float32)
    for _ in range(2):
        assert not vector.step(still)[3].any()
    ends, _, terminated, truncated, _ = vector.step(still)
    assert truncated.all()
    assert not terminated.any()
    starts, rewards, _, truncated, _ = vector.step(still)
    assert (rewards == 0.0).all()
    assert not truncated.any()
    assert (starts[:, 3:6] != ends[:, 3:6]).any(axis=1).all()  # other goals


@pytest.mark.parametrize('value', [np.nan, np.inf])
def test_an_action_that_is_not_finite_ends_the_episode_of_its_environment_alone(vector, value):
    vector.reset(seed=0)
    actions = np.zeros((3, 3), dtype=np.float32)
    actions[1, 2] = value
    _, _, terminated, _, info = vector.step(actions)
    assert terminated.tolist() == [False, True, False]
    assert 'must be 3 finite numbers' in info['reason'][1]
    assert info['reason'][0] == ''
    assert not vector.step(0.0 * np.nan_to_num(actions))[2].any()


def test_a_goal_out_of_reach_is_truncated_not_an_error(env):
    env.reset(seed=0, options={'goal': (9.0, 9.0, 0.0)})
    steps = [env.step(np.array([0.02, 0.02, 0.0], dtype=np.float32)) for _ in range(3)]
    assert not any(lost for _, _, lost, _, _ in steps)


@pytest.mark.parametrize('wrench', [(0.0, 0.0, 0.0), (0.0, -80.0, 0.0)])
def test_pictures_show_the_object_where_it_is_also_when_it_is_lost(wrench):
    pytest.importorskip('matplotlib')
    env = gymnasium.make(ENVIRONMENT, render_mode='rgb_array')
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.unwrapped.render()
    env.reset(seed=0)
    before = env.render()
    env.reset(seed=0, options={'external_wrench': wrench})
    env.step(np.array([0.02, 0.0, 0.0], dtype=np.float32))
    after = env.render()
    assert before.shape == (640, 640, 3)
    assert before.dtype == np.uint8
    assert (before != after).any()
    assert env.metadata['render_fps'] == 20


def test_record_video_writes_a_film(tmp_path):
    pytest.importorskip('matplotlib')
    pytest.importorskip('moviepy')
    env = gymnasium.make(ENVIRONMENT, render_mode='rgb_array', max_episode_steps=3)
    film = gymnasium.wrappers.RecordVideo(env, str(tmp_path), episode_trigger=lambda _: True)
    film.reset(seed=0)
    for _ in range(3):
        film.step(np.zeros(3, dtype=np.float32))
    film.close()
    assert [path.suffix for path in tmp_path.iterdir()] == ['.mp4']


def test_human_mode_draws_in_one_window():
    pyplot = pytest.importorskip('matplotlib.pyplot')
    pyplot.switch_backend('Agg')
    env = gymnasium.make(ENVIRONMENT, render_mode='human')
    env.reset(seed=0)
    env.step(np.zeros(3, dtype=np.float32))
    assert len(pyplot.get_fignums()) == 1
    env.close()
    assert not pyplot.get_fignums()


def test_reward_is_a_function_of_the_step():
    steps = []

    def reward(transition):
        steps.append(transition)
        return -transition.slip_margin

    env = gymnasium.make(ENVIRONMENT, reward=reward)
    env.reset(seed=0)
    _, value, _, _, info = env.step(np.array([0.01, 0.0, 0.0], dtype=np.float32))
    assert value == -info['slip_margin']
    (step,) = steps
    assert step.pose.x - step.previous.x == pytest.approx(0.01 * 0.05, rel=0.05)
    assert step.twist == pytest.approx([0.01, 0.0, 0.0])
    assert not step.is_lost


def test_default_reward_is_the_progress_less_a_penalty_for_a_loss():
    previous, pose, goal = Pose(0.0, 0.0, 0.0), Pose(0.3, 0.0, 1.0), Pose(0.3, 0.4, 0.0)
    step = Transition(previous, pose, goal, np.zeros(3), 1.0, False)
    assert progress_reward(step) == pytest.approx(0.1)
    assert progress_reward(step._replace(is_lost=True)) == pytest.approx(-0.1)


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        ({'slip': 0.7}, 'slip 0.7: must be from 0 to 0.5'),
        ({'period': 0.0}, 'period 0.0 s: must be from'),
        ({'friction': 0.01}, 'must hold the object at the start: .*friction'),
        ({'max_twist': (0.1, -0.1, 0.1)}, r'max_twist .*: must not be negative'),
        ({'members': ('north/P-Z', 'nowhere')}, "'nowhere'"),
        ({'render_mode': 'ansi'}, "render_mode 'ansi': must be one of"),
        ({'reward': 3}, r'argument reward: .*such as `progress_reward`'),
    ],
)
def test_invalid_arguments_are_named(arguments, words):
    with pytest.raises(IsotrussError, match=words):
        HeldObjectEnv(**arguments)


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        ({'gaol': (0.0, 0.0, 0.0)}, "option 'gaol': did you mean goal?"),
        ({'goal': (0.0, 0.0)}, 'goal .*must be 3 finite numbers'),
        ({'goal': (750.0, 760.0, 0.0)}, r'goal \(750.*: x must be .* if it is in mm'),
        ({'external_wrench': 'down'}, 'external wrench'),
    ],
)
def test_invalid_options_of_a_reset_are_named(env, options, words):
    with pytest.raises(GraspError, match=words):
        env.reset(options=options)


def test_an_action_that_is_not_finite_is_named(env):
    env.reset(seed=0)
    with pytest.raises(GraspError, match=r'action .*must be 3 finite numbers'):
        env.unwrapped.step(np.array([0.0, np.nan, 0.0]))


def test_without_gymnasium_its_installation_is_named(monkeypatch):
    for name in [name for name in sys.modules if name.startswith('isotruss_ros.learning')]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, 'gymnasium', None)
    with pytest.raises(MissingPackageError, match=r"pip install 'isotruss_ros\[learning\]'"):
        import isotruss_ros.learning  # noqa: F401
