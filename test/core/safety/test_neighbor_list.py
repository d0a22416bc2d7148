"""The neighbour list against measuring all distances in every state."""

from types import SimpleNamespace

from hypothesis import given, strategies
from isotruss_ros.core import ConfigurationError, Grasp, load_robot, tangent_center
from isotruss_ros.core.safety.distances import collision_model
from isotruss_ros.core.safety.neighbor_list import NeighborList
import numpy as np
import robots

ROBOT = load_robot('nine_member')
MODEL = collision_model(ROBOT)
NEAR = 0.12


def walk(seed, count=60, step=2e-3):
    """Yield the configurations of a random walk of the rollers."""
    random = np.random.default_rng(seed)
    config, velocity = ROBOT.home, random.normal(size=len(ROBOT.roller_names))
    for _ in range(count):
        velocity += 0.3 * random.normal(size=len(velocity)) - 0.1 * velocity
        try:
            config = config.moved_to(config.roller_positions + step * velocity)
        except ConfigurationError:  # the edge of the workspace
            return
        yield config


@robots.examples(10)
@given(strategies.integers(0, 10**6))
def test_finds_the_pairs_that_measuring_all_finds(seed):
    robot_pairs, object_parts, measured = NeighborList(NEAR), NeighborList(NEAR), []
    grasp = Grasp('east/Q', tangent_center(ROBOT.home, 'east/Q', 0.3), 0.3)
    configs = list(walk(seed))
    for config in configs:
        every = MODEL.distances(config)

        def measure(pairs, every=every):
            measured.append(len(every[pairs]))
            return every[pairs]

        pairs, distances = robot_pairs.find_close(config, None, measure)
        np.testing.assert_array_equal(pairs, np.flatnonzero(every < NEAR))
        np.testing.assert_array_equal(distances, every[every < NEAR])
        apart = MODEL.object_distances(config, grasp, 'east/Q')
        parts, distances = object_parts.find_close(config, grasp, apart.__getitem__)
        np.testing.assert_array_equal(parts, np.flatnonzero(apart < NEAR))
        np.testing.assert_array_equal(distances, apart[apart < NEAR])
        grasp = Grasp('east/Q', np.add(grasp.center, 1e-3), 0.3)
    assert sum(measured) < len(configs) * len(every) / 2


def test_measures_nothing_again_before_it_may_be_close():
    list_, count = NeighborList(0.01), []

    def find(config, grasp=None):
        count.append(0)

        def measure(pairs):
            count[-1] += 1
            return np.array([0.05, 0.5])[pairs]  # 0.04 m are spare

        return list_.find_close(config, grasp, measure)[0].tolist()

    def moved(distance):
        return SimpleNamespace(points=ROBOT.home.points + distance)

    # Two parts may come nearer by twice what each of them moves.
    for distance in (0.0, 0.0199, 0.0201):
        assert find(moved(distance)) == []
    assert count == [1, 0, 1]


def test_measures_another_object_again():
    list_, count = NeighborList(0.01), []

    def find(grasp):
        return list_.find_close(
            ROBOT.home, grasp, lambda pairs: count.append(1) or np.array([0.5])[pairs]
        )

    for grasp, measured in (
        (Grasp('east/Q', (0.0, 0.0), 0.3), 1),
        (Grasp('east/Q', (0.0, 0.0), 0.3), 1),
        (Grasp('east/Q', (0.0, 0.0), 0.31), 2),
        (Grasp('west/R', (0.0, 0.0), 0.31), 3),
    ):
        find(grasp)
        assert len(count) == measured
