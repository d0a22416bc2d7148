# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Correction of an object that the closing grip has displaced, with noisy poses."""

import math

from isotruss_msgs.action import FollowObjectPath
from isotruss_ros.core import Pose
from isotruss_ros.nodes.conversions.messages import read_pose
from isotruss_ros.nodes.pick_and_place.node import PickAndPlace
from isotruss_ros.nodes.pick_and_place.object_watch import AveragePose
from manual_world import world
import numpy as np
from probe import CENTER, maker
import pytest

NOISE, DISPLACEMENT = 1e-3, 8e-3
FIRST = AveragePose(Pose(*CENTER, 0.3), NOISE, 25)


class RecordedMotion:
    """Stand-in for the action of `path_follower`, which has no effect."""

    goal = None

    def run(self, goal, find_fault):
        """Record the goal, and report it as reached."""
        self.goal = goal
        assert find_fault() is None
        yield 1.0
        return FollowObjectPath.Result(code=FollowObjectPath.Result.REACHED)


def correct(displacement, noise, seed=0):
    """Return the note on a correction, and the goal of its motion."""
    random = np.random.default_rng(seed)
    with world(maker(PickAndPlace, command_timeout=1.0)()) as w:
        sequences = w.nodes[1]._sequences
        sequences._object = motion = RecordedMotion()

        def send():
            w.probe.send_joints()
            w.probe.send_pose(center=CENTER + random.normal((0.0, displacement), noise))

        w.spin(0.1, send)
        steps = sequences._bring_back(FIRST)
        while True:
            try:
                next(steps)
            except StopIteration as end:
                return end.value, motion.goal
            w.spin(0.02, send)


@pytest.mark.parametrize('seed', range(5))
def test_a_path_from_the_mean_admits_noisy_readings(seed):
    _, goal = correct(DISPLACEMENT, NOISE, seed)
    begin = read_pose('begin', goal.path.poses[0].pose)
    assert begin[:2] == pytest.approx((CENTER[0], CENTER[1] + DISPLACEMENT), abs=5e-4)
    there = CENTER[0], CENTER[1] + DISPLACEMENT
    readings = np.random.default_rng(99).normal(there, NOISE, (2000, 2))
    off = np.hypot(*(readings - begin[:2]).T)
    assert (off > goal.position_tolerance).mean() < 1e-3
    # 21 % of pairs of single readings are farther apart than the tolerance without noise.
    pairs = np.hypot(*(readings[1:] - readings[:-1]).T)
    assert (pairs > 2.5e-3).mean() == pytest.approx(math.exp(-(2.5**2) / 4.0), abs=0.04)


def test_a_path_without_noise_keeps_its_tolerance():
    _, goal = correct(DISPLACEMENT, 0.0)
    assert goal.position_tolerance == pytest.approx(2.5e-3)


def test_a_displacement_within_noise_is_not_corrected():
    note, goal = correct(1.2e-3, 10e-3)
    assert (note, goal) == ('', None)


def test_the_note_has_the_deviation_of_the_means():
    note, _ = correct(DISPLACEMENT, NOISE)
    assert 'displaced the object by 8' in note
    # The noise of a mean of 25 poses is a fifth of that of one.
    assert float(note.split('deviation ')[1].split()[0]) == pytest.approx(
        1e3 * NOISE * math.sqrt(2.0 / 25.0), rel=0.4
    )


def test_mean_of_poses_beside_half_a_turn_is_there():
    mean = AveragePose.of([Pose(0.0, 0.0, 3.1), Pose(0.0, 2.0, -3.1)])
    assert abs(mean.pose.angle) == pytest.approx(math.pi)
    assert mean.pose[:2] == pytest.approx((0.0, 1.0))
    assert mean.noise == pytest.approx(math.sqrt(2.0))
