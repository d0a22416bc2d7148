# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Mechanics, estimation and control of isoperimetric truss robots, without ROS.

robot -> configuration -> grip -> twist to rollers (docs/kinematics.md);
robot -> structure -> contact -> held object (docs/statics.md).
`fixed_object` is the paper's analysis of an object held fast.
Entry points: the names in `__all__`, the public API.
Imports NumPy, SciPy, ruamel.yaml and jsonschema, no ROS; a module is imported at the first use of
its name, so that a part of the core loads without the rest.
"""

from __future__ import annotations

import importlib
import importlib.util
from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from isotruss_ros.core.chance.uncertainty import Uncertainty
    from isotruss_ros.core.errors import IsotrussError
    from isotruss_ros.core.fixed_object.analyze_grasp import analyze_grasp
    from isotruss_ros.core.holding.grasp_gradient import grasp_gradient
    from isotruss_ros.core.holding.held_grip import HoldStatus
    from isotruss_ros.core.holding.settle_grasp import settle_grasp, settle_grasps
    from isotruss_ros.core.kinematics.configuration import Configuration
    from isotruss_ros.core.kinematics.robot import load_robot, Robot
    from isotruss_ros.core.manipulation.grip import Grip
    from isotruss_ros.core.manipulation.grip_placing import place_between, tangent_center
    from isotruss_ros.core.manipulation.rolling_grip import RollingGrip
    from isotruss_ros.core.manipulation.solve_twist import (
        reachable_twists,
        solve_joint_velocity,
        solve_twist,
        solve_twist_ahead,
    )
    from isotruss_ros.core.manipulation.status import Status
    from isotruss_ros.core.model.convex_object import ConvexObject
    from isotruss_ros.core.model.ellipse import Ellipse
    from isotruss_ros.core.model.object_file import read_object
    from isotruss_ros.core.model.obstacle import Obstacle
    from isotruss_ros.core.model.obstacle_file import read_obstacles
    from isotruss_ros.core.model.polygon import Polygon
    from isotruss_ros.core.model.pose import Pose
    from isotruss_ros.core.model.shapes import Disc
    from isotruss_ros.core.paths.object_path import ObjectPath
    from isotruss_ros.core.paths.path_tracking import PathTracker
    from isotruss_ros.core.planning.plan_grasps import plan_grasps
    from isotruss_ros.core.planning.plan_path import plan_path
    from isotruss_ros.core.planning.reach_pose import reach_pose
    from isotruss_ros.core.planning.requirements import GraspRequirements
    from isotruss_ros.core.safety.shape_guard import ShapeGuard
    from isotruss_ros.core.servo.twist_servo import TwistServo
    from isotruss_ros.core.simulation.elastic_object import ElasticObject
    from isotruss_ros.core.simulation.rigid_object import RigidObject
    from isotruss_ros.core.simulation.simulated_robot import RollerFaults, SimulatedRobot
    from isotruss_ros.core.statics.deform import deform

__all__ = [
    'Configuration',
    'ConvexObject',
    'Disc',
    'ElasticObject',
    'Ellipse',
    'GraspRequirements',
    'Grip',
    'HoldStatus',
    'IsotrussError',
    'ObjectPath',
    'Obstacle',
    'PathTracker',
    'Polygon',
    'Pose',
    'RigidObject',
    'Robot',
    'RollerFaults',
    'RollingGrip',
    'ShapeGuard',
    'SimulatedRobot',
    'Status',
    'TwistServo',
    'Uncertainty',
    'analyze_grasp',
    'deform',
    'grasp_gradient',
    'load_robot',
    'place_between',
    'plan_grasps',
    'plan_path',
    'reach_pose',
    'reachable_twists',
    'read_object',
    'read_obstacles',
    'settle_grasp',
    'settle_grasps',
    'solve_joint_velocity',
    'solve_twist',
    'solve_twist_ahead',
    'tangent_center',
]

#: Module of each name, below this package.
_MODULES = {
    'Configuration': 'kinematics.configuration',
    'ConvexObject': 'model.convex_object',
    'Disc': 'model.shapes',
    'ElasticObject': 'simulation.elastic_object',
    'Ellipse': 'model.ellipse',
    'GraspRequirements': 'planning.requirements',
    'Grip': 'manipulation.grip',
    'HoldStatus': 'holding.held_grip',
    'IsotrussError': 'errors',
    'ObjectPath': 'paths.object_path',
    'Obstacle': 'model.obstacle',
    'PathTracker': 'paths.path_tracking',
    'Polygon': 'model.polygon',
    'Pose': 'model.pose',
    'RigidObject': 'simulation.rigid_object',
    'Robot': 'kinematics.robot',
    'RollerFaults': 'simulation.simulated_robot',
    'RollingGrip': 'manipulation.rolling_grip',
    'ShapeGuard': 'safety.shape_guard',
    'SimulatedRobot': 'simulation.simulated_robot',
    'Status': 'manipulation.status',
    'TwistServo': 'servo.twist_servo',
    'Uncertainty': 'chance.uncertainty',
    'analyze_grasp': 'fixed_object.analyze_grasp',
    'deform': 'statics.deform',
    'grasp_gradient': 'holding.grasp_gradient',
    'load_robot': 'kinematics.robot',
    'place_between': 'manipulation.grip_placing',
    'plan_grasps': 'planning.plan_grasps',
    'plan_path': 'planning.plan_path',
    'reach_pose': 'planning.reach_pose',
    'reachable_twists': 'manipulation.solve_twist',
    'read_object': 'model.object_file',
    'read_obstacles': 'model.obstacle_file',
    'settle_grasp': 'holding.settle_grasp',
    'settle_grasps': 'holding.settle_grasp',
    'solve_joint_velocity': 'manipulation.solve_twist',
    'solve_twist': 'manipulation.solve_twist',
    'solve_twist_ahead': 'manipulation.solve_twist',
    'tangent_center': 'manipulation.grip_placing',
}


def __getattr__(name: str) -> Any:
    """Import a name of the public API, or a package, at its first use (SPEC 1)."""
    if name in _MODULES:
        globals()[name] = getattr(importlib.import_module(f'{__name__}.{_MODULES[name]}'), name)
    elif importlib.util.find_spec(f'{__name__}.{name}'):
        importlib.import_module(f'{__name__}.{name}')
    else:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return globals()[name]


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
