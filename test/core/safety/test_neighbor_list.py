# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The neighbour list against measuring all distances in every state."""

from types import SimpleNamespace

from isotruss_ros.core import ConvexObject, Grip, load_robot, Polygon
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.safety.barriers import NeighborList
import numpy as np
import pytest

ROBOT = load_robot('nine_member')
MODEL = collision_model(ROBOT)
NEAR = 0.12


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


@pytest.mark.parametrize('kind', ['a disc', 'a polygon', 'a polygon that turns'])
def test_measures_again_where_the_object_may_have_come_close(kind):
    shape = Polygon([(-0.3, -0.4), (0.3, -0.4), (0.3, 0.4), (-0.3, 0.4)])

    def held(distance):
        if kind == 'a disc':
            return Grip.at_module(
                ROBOT, 'east/Q', ConvexObject.disc((0.6 * distance, 0.8 * distance), 0.3)
            )
        # No point is farther than 0.5 m from the origin, about which it turns.
        turn = 2.0 * np.arcsin(0.25 * distance / 0.5) if kind.endswith('turns') else 0.0
        pose = (0.5 * distance if turn else distance, 0.0, turn)
        return Grip(('south/P-Q', 'north/R-P'), ConvexObject(shape, pose))

    # 0.4 m are spare: object and part may come nearer by what both of them move.
    for own, part, again in ((0.39, 0.0, 0), (0.41, 0.0, 1), (0.3, 0.09, 0), (0.3, 0.11, 1)):
        list_, measured = NeighborList(0.1), []

        def measure(pairs, measured=measured):
            measured.append(pairs)
            return np.array([0.5, 0.9])[pairs]

        list_.find_close(ROBOT.home, held(0.0), measure)
        moved = SimpleNamespace(points=ROBOT.home.points + part)
        list_.find_close(moved, held(own), measure)
        assert len(measured) == 1 + again


def test_measures_another_object_again():
    list_, count = NeighborList(0.01), []

    def find(grasp):
        return list_.find_close(
            ROBOT.home, grasp, lambda pairs: count.append(1) or np.array([0.5])[pairs]
        )

    for module, diameter, measured in (
        ('east/Q', 0.3, 1),
        ('east/Q', 0.3, 1),
        ('east/Q', 0.31, 2),
        ('north/R', 0.31, 3),
    ):
        find(Grip.at_module(ROBOT, module, ConvexObject.disc((0.0, 0.0), diameter)))
        assert len(count) == measured
