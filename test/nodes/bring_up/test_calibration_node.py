# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Roller offsets, stiffness and frequency of a simulated robot, measured by nodes."""

import math

from geometry_msgs.msg import Twist, Vector3
from isotruss_msgs.msg import ManipulationStatus
from isotruss_msgs.srv import CalibrateStiffness
from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.core import load_robot
from isotruss_ros.nodes.bring_up.calibration import Calibration
from isotruss_ros.nodes.bring_up.pluck import Pluck, PUSH_TIME
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.simulator.node import Simulator
from manual_world import world
from mujoco_worlds import needs_mujoco
import numpy as np
from probe import maker, overrides, ROBOT
import pytest
from std_srvs.srv import Trigger

NAMES = ROBOT.topology.joint_names
TRACKER = {'tracker_rate': 20.0, 'tracker_noise': 0.001, 'tracker_dropouts': 0.3, 'seed': 4}
#: The encoders read zero 15 mm from the home.
plant = maker(
    Simulator,
    object_is_free=True,
    object_pose=[0.6, 5.0, 0.0],
    zero_deviation=0.015,
    marker_joints=['all'],
    **TRACKER,
)


def calibrating(tmp_path):
    return lambda: Calibration(overrides(output=str(tmp_path / 'mine.yaml')))


@pytest.mark.parametrize('kind', ['kinematic', pytest.param('mujoco', marks=needs_mujoco)])
def test_written_home_agrees_with_the_simulated_robot(tmp_path, kind):
    with world(plant(plant=kind), calibrating(tmp_path)) as w:
        w.spin(1.5)
        answer = w.call('calibrate_home', Trigger.Request())
        truth = w.nodes[1].robot.home
    assert answer.success, answer.message
    assert 'roller offsets [mm]: south/P' in answer.message
    result = load_robot(tmp_path / 'mine.yaml').home
    off = (result.nodes - truth.nodes)[: len(NAMES)]
    assert np.hypot.reduce(off, axis=1).max() < 1.5e-3
    assert np.abs((truth.nodes - ROBOT.home.nodes)[: len(NAMES)]).max() > 0.015


@needs_mujoco
def test_a_plant_as_stiff_as_the_model_has_a_stiffness_scale_of_one(tmp_path):
    with world(plant(plant='mujoco'), calibrating(tmp_path)) as w:
        w.spin(1.5)
        assert w.call('calibrate_home', Trigger.Request()).success
        w.nodes[1]._plant.plant.load_joint('Z', (10.0, 0.0))
        w.spin(2.5)
        request = CalibrateStiffness.Request(joint='Z', force=Vector3(x=10.0))
        answer = w.call('calibrate_stiffness', request)
    assert answer.success, answer.message
    assert answer.scale == pytest.approx(1.0, rel=0.07)
    description = load_robot(tmp_path / 'mine.yaml').description
    assert description.stiffness_scale == pytest.approx(answer.scale, rel=1e-3)


def test_a_force_in_another_posture_is_refused(tmp_path):
    with world(plant(), calibrating(tmp_path)) as w:
        w.spin(1.5)
        answer = w.call('calibrate_stiffness', CalibrateStiffness.Request(joint='Z'))
    assert not answer.success
    assert answer.message.endswith('first call calibrate_home')


def test_missing_markers_are_reported(tmp_path):
    with world(plant(marker_joints=['']), calibrating(tmp_path)) as w:
        w.spin(1.5)
        answer = w.call('calibrate_home', Trigger.Request())
    assert not answer.success
    assert answer.message == 'joint markers: none received yet'
    assert not (tmp_path / 'mine.yaml').exists()


HELD = {'object_diameter': 0.2, 'friction': 0.8}
manipulation = maker(Manipulation, **HELD)
pluck = maker(Pluck, object_diameter=0.2)
held_in_mujoco = maker(Simulator, plant='mujoco', indentation=0.01, **HELD)


def test_frequency_and_damping_ratio_are_fitted_to_the_poses_after_the_push():
    frequency, ratio, begun = 12.0, 0.1, []
    with world(pluck()) as w:
        w.probe.listen(Twist, 'twist', 'cmd_vel')
        statuses = w.probe.create_publisher(ManipulationStatus, 'manipulation/status', 1)

        def send():
            statuses.publish(ManipulationStatus())
            if not begun and w.probe.last('twist') not in (None, Twist()):
                begun.append(w.now)
            time = w.now - begun[0] - PUSH_TIME if begun else -1.0
            angle = frequency * math.sqrt(1.0 - ratio**2) * time
            swing = 2e-3 * math.exp(-ratio * frequency * time) * math.cos(angle)
            w.probe.send_object((swing if time > 0.0 else 0.05, 0.3, 0.0))

        w.until(lambda: w.nodes[1].done, send)
        result = w.nodes[1].oscillation
    assert result.frequency == pytest.approx(frequency, rel=0.01)
    assert result.damping_ratio == pytest.approx(ratio, rel=0.05)


@needs_mujoco
def test_active_squeeze_control_is_refused():
    with (
        pytest.raises(MeasurementError, match='squeeze_force of manipulation: must be 0'),
        world(held_in_mujoco(), manipulation(squeeze_force=20.0, object_mass=0.5), pluck()) as w,
    ):
        w.until(lambda: w.nodes[-1].done)


def test_missing_poses_are_named():
    with (
        pytest.raises(MeasurementError, match='object_pose: no message'),
        world(lambda: Pluck(overrides(wait_time=1.0))) as w,
    ):
        w.until(lambda: w.nodes[-1].done)
