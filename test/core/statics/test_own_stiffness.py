# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A stiffness model of one's own: a tube that is softer in bending the longer it is."""

from dataclasses import dataclass, replace

from isotruss_ros import core
from isotruss_ros.core.estimation.state_estimator import StateEstimator
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.statics import tube_stiffness
from isotruss_ros.core.statics.tube_stiffness import broadcast_members, SectionStiffness
import numpy as np
import pytest

ROBOT = core.load_robot('nine_member')


@dataclass(frozen=True)
class SofterTube:
    """EI that falls with the length of the member."""

    flexural: float
    exponent: float
    fabric = None

    def section_stiffness(self, length, pressure):
        """Return EA, EI and GA of whole members."""
        length, _ = broadcast_members(length, pressure)
        falling = self.flexural * length**-self.exponent
        return SectionStiffness(0.0 * length + 2.0e4, falling, 0.0 * length + 1.5e3)

    @classmethod
    def of_block(cls, block, description):
        """Return the model of a robot file."""
        return cls(**block)


def robot_with(**stiffness):
    """Return the robot as a file with another block `stiffness` describes it."""
    return Robot(replace(ROBOT.description, stiffness=stiffness))


@pytest.fixture
def listed(monkeypatch):
    """Add the model by one line."""
    monkeypatch.setitem(tube_stiffness.MODELS, 'softer', SofterTube)


def moved(robot):
    """Return how the loaded joint moves."""
    joint = next(iter(robot.topology.joint_names))
    return core.deform(robot.home, {joint: (3.0, -8.0)}).state.displacements


def test_without_its_exponent_it_is_the_model_of_three_numbers(listed):
    own = robot_with(model='softer', flexural=30.0, exponent=0.0)
    numbers = {'axial_rigidity': 2.0e4, 'flexural_rigidity': 30.0, 'shear_rigidity': 1.5e3}
    section = robot_with(model='section', **numbers)
    assert moved(own) == pytest.approx(moved(section), rel=1e-12, abs=1e-15)


def test_user_defined_stiffness_supports_gradient_planner_and_estimator(listed):
    robot = robot_with(model='softer', flexural=30.0, exponent=0.5)
    body = core.ConvexObject.disc(core.tangent_center(robot.home, 'north/Z', 0.3, 0.02), 0.3)
    gradient = core.grasp_gradient(core.settle_grasp(robot.home, body, 0.8))
    assert (gradient.normal_forces[:, gradient.parameters.rollers] != 0.0).any()
    free = core.ConvexObject.disc(core.tangent_center(robot.home, 'north/Z', 0.3, -0.1), 0.3)
    assert core.plan_grasps(robot.home, free, core.GraspRequirements(count=1, friction=0.8))
    estimator = StateEstimator(robot)
    estimator.set_grip(core.Grip.at_module(robot, 'north/Z', body, 0.8))
    estimator.take_encoders(0.0, np.zeros(len(robot.roller_names)))
    estimator.take_pose(0.0, body.pose, np.array([1e-3, 1e-3, 0.01]))
    assert np.isfinite(estimator.estimate().squeeze)
