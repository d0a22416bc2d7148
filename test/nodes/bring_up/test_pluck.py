# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The frequency of a held object, plucked by the rollers."""

from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.calibration.oscillation import fit_oscillation
from isotruss_ros.nodes.bring_up.pluck import Pluck
from isotruss_ros.nodes.conversions.messages import read_stamp
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.simulator.node import Simulator
from manual_world import world
from mujoco_worlds import needs_mujoco
import numpy as np
from probe import maker, overrides, planar
import pytest

HELD = {'object_diameter': 0.2, 'friction': 0.8}


def plant():
    return Simulator(overrides(plant='mujoco', indentation=0.01, **HELD))


manipulation = maker(Manipulation, **HELD)


def pluck():
    return Pluck(overrides(object_diameter=0.2))


@pytest.mark.nightly
@needs_mujoco
def test_frequency_is_that_of_the_oscillation_after_a_released_force():
    with world(plant, manipulation(), pluck) as w:
        node = w.nodes[3]
        w.until(lambda: node.done)
        w.remove(node)
        w.spin(1.0, lambda: w.probe.send_wrench((0.3, 0.0, 0.0)))
        w.probe.send_wrench((0.0, 0.0, 0.0))
        w.probe.seen['pose'].clear()
        w.spin(1.0)
        times = [read_stamp(message.header) for _, message in w.probe.seen['pose']]
        poses = [planar(message) for _, message in w.probe.seen['pose']]
    expected = fit_oscillation(np.array(times), poses, 0.1)
    assert node.oscillation.frequency == pytest.approx(expected.frequency, rel=0.1)
    assert 0.02 < node.oscillation.damping_ratio < 0.5


@needs_mujoco
def test_active_squeeze_control_is_refused():
    with (
        pytest.raises(MeasurementError, match='squeeze_force of manipulation: must be 0'),
        world(plant, manipulation(squeeze_force=20.0, object_mass=0.5), pluck) as w,
    ):
        w.until(lambda: w.nodes[-1].done)


def test_missing_poses_are_named():
    with (
        pytest.raises(MeasurementError, match='object_pose: no message'),
        world(lambda: Pluck(overrides(wait_time=1.0))) as w,
    ):
        w.until(lambda: w.nodes[-1].done)
