# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The mathematics of isoperimetric truss robots, without ROS.

robot -> configuration -> grasp -> twist to rollers (docs/kinematics.md);
robot -> structure -> contact -> closure (docs/statics.md).
"""

from isotruss_ros.core.control.grasp_monitor import GraspMonitor
from isotruss_ros.core.control.grasp_report import (
    AnalyzedGrasp,
    GraspCode,
    GraspQuery,
    GraspReport,
)
from isotruss_ros.core.control.inputs import RejectedInput, RollerState, StampedInput
from isotruss_ros.core.control.object_path import ObjectPath
from isotruss_ros.core.control.path_tracking import (
    PathPhase,
    PathTracker,
    Tracking,
    TrackingSettings,
)
from isotruss_ros.core.control.roller_trajectory import RollerTrajectory
from isotruss_ros.core.control.twist_servo import Decision, TwistServo
from isotruss_ros.core.errors import (
    ConfigurationError,
    GraspError,
    IsotrussError,
    ObjectFileError,
    PathError,
    RobotFileError,
    SolverError,
    StructureError,
)
from isotruss_ros.core.grasping.analysis import analyze_grasp, GraspAnalysis
from isotruss_ros.core.grasping.hold_status import HoldStatus
from isotruss_ros.core.grasping.settle_grasp import settle_grasp, SettledGrasp
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.rigidity import worst_case_rigidity_index
from isotruss_ros.core.kinematics.robot import load_robot, Robot
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.grip_placing import place_between
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.manipulation.limits import Limit, MemberLengthLimit, RollerSpeedLimit
from isotruss_ros.core.manipulation.rolling_grip import RollingGrip
from isotruss_ros.core.manipulation.solve_joint_velocity import JointCommand, solve_joint_velocity
from isotruss_ros.core.manipulation.solve_twist import (
    reachable_twists,
    RollerCommand,
    solve_twist,
    solve_twist_ahead,
)
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.manipulation.tangent_center import tangent_center
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.ellipse import Ellipse
from isotruss_ros.core.model.object_file import object_from_mapping, read_object
from isotruss_ros.core.model.polygon import Polygon
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.model.presets import preset_names
from isotruss_ros.core.model.shapes import Disc
from isotruss_ros.core.planning.grasp_plan import GraspPlan, PlannedGrasp, Progress, Violation
from isotruss_ros.core.planning.plan_grasps import plan_grasps
from isotruss_ros.core.planning.release import plan_release, Release
from isotruss_ros.core.planning.requirements import GraspRequirements, Measure
from isotruss_ros.core.safety.margins import shape_margins, ShapeMargins
from isotruss_ros.core.safety.roller_failure import FailureCriterion, FailureDetector
from isotruss_ros.core.safety.shape_guard import ShapeBounds, ShapeGuard
from isotruss_ros.core.simulation.elastic_object import ElasticObject
from isotruss_ros.core.simulation.free_object import FreeObject
from isotruss_ros.core.simulation.rolling_object import RollingObject
from isotruss_ros.core.simulation.simulated_robot import RollerFaults, SimulatedRobot
from isotruss_ros.core.statics.structure import deform, Deformation

__all__ = [
    'AnalyzedGrasp',
    'Configuration',
    'ConfigurationError',
    'ConvexObject',
    'Decision',
    'Deformation',
    'Disc',
    'ElasticObject',
    'Ellipse',
    'FailureCriterion',
    'FailureDetector',
    'FreeObject',
    'GraspAnalysis',
    'GraspCode',
    'GraspError',
    'GraspMonitor',
    'GraspPlan',
    'GraspQuery',
    'GraspReport',
    'GraspRequirements',
    'Grip',
    'HoldStatus',
    'IsotrussError',
    'JointCommand',
    'Limit',
    'Measure',
    'MemberLengthLimit',
    'ObjectFileError',
    'ObjectPath',
    'PathError',
    'PathPhase',
    'PathTracker',
    'PlannedGrasp',
    'Polygon',
    'Pose',
    'Progress',
    'RejectedInput',
    'Release',
    'Robot',
    'RobotFileError',
    'RollerCommand',
    'RollerFaults',
    'RollerSpeedLimit',
    'RollerState',
    'RollerTrajectory',
    'RollingGrip',
    'RollingObject',
    'SettledGrasp',
    'ShapeBounds',
    'ShapeGuard',
    'ShapeMargins',
    'SimulatedRobot',
    'SolverError',
    'StampedInput',
    'Status',
    'StructureError',
    'Tracking',
    'TrackingSettings',
    'TwistServo',
    'Violation',
    'analyze_grasp',
    'deform',
    'grip_jacobian',
    'load_robot',
    'object_from_mapping',
    'place_between',
    'plan_grasps',
    'plan_release',
    'preset_names',
    'reachable_twists',
    'read_object',
    'settle_grasp',
    'shape_margins',
    'solve_joint_velocity',
    'solve_twist',
    'solve_twist_ahead',
    'tangent_center',
    'worst_case_rigidity_index',
]
