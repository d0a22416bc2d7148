"""
The mathematics of isoperimetric truss robots, without ROS.

robot -> configuration -> grasp -> twist to rollers (docs/kinematics.md);
robot -> structure -> contact -> closure (docs/statics.md).
"""

from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.errors import (
    ConfigurationError,
    GraspError,
    IsotrussError,
    PathError,
    RobotFileError,
    SolverError,
    StructureError,
)
from isotruss_ros.core.failure_detector import FailureCriterion, FailureDetector
from isotruss_ros.core.grasp import Grasp, snug_center
from isotruss_ros.core.grasp_analysis import analyze_grasp, Cylinder, GraspAnalysis
from isotruss_ros.core.grasp_monitor import GraspMonitor
from isotruss_ros.core.grasp_plan import GraspPlan, Miss, PlannedGrasp, Progress
from isotruss_ros.core.grasp_report import AnalyzedGrasp, GraspCode, GraspReport, Question
from isotruss_ros.core.grasp_search import plan_grasps
from isotruss_ros.core.limits import Limit, MemberLengthLimit, RollerSpeedLimit
from isotruss_ros.core.loose_object import LooseObject
from isotruss_ros.core.manipulation import remaining_task, RollerCommand, solve_twist
from isotruss_ros.core.motion import HeldObject, Pose, solve_twist_ahead
from isotruss_ros.core.object_path import ObjectPath
from isotruss_ros.core.path_tracking import PathPhase, PathTracker, Tracking, TrackingSettings
from isotruss_ros.core.presets import preset_names
from isotruss_ros.core.requirements import GraspRequirements, Measure
from isotruss_ros.core.resting import find_resting_pose, RestingPose
from isotruss_ros.core.robot import load_robot, Robot
from isotruss_ros.core.roller_path import RollerPath
from isotruss_ros.core.samples import Refusal, RollerState, Sample
from isotruss_ros.core.servo import Decision, TwistServo
from isotruss_ros.core.settling import settle, Settled
from isotruss_ros.core.shape_guard import ShapeBounds, ShapeGuard
from isotruss_ros.core.shape_margins import shape_margins, ShapeMargins
from isotruss_ros.core.simulation import RollerFaults, SimulatedRobot
from isotruss_ros.core.status import Status
from isotruss_ros.core.structure import deform, Deformation
from isotruss_ros.core.task import task_jacobian

__all__ = [
    'AnalyzedGrasp',
    'Configuration',
    'ConfigurationError',
    'Cylinder',
    'Decision',
    'Deformation',
    'FailureCriterion',
    'FailureDetector',
    'Grasp',
    'GraspAnalysis',
    'GraspCode',
    'GraspError',
    'GraspMonitor',
    'GraspPlan',
    'GraspReport',
    'GraspRequirements',
    'HeldObject',
    'IsotrussError',
    'Limit',
    'LooseObject',
    'Measure',
    'MemberLengthLimit',
    'Miss',
    'ObjectPath',
    'PathError',
    'PathPhase',
    'PathTracker',
    'PlannedGrasp',
    'Pose',
    'Progress',
    'Question',
    'Refusal',
    'RestingPose',
    'Robot',
    'RobotFileError',
    'RollerCommand',
    'RollerFaults',
    'RollerPath',
    'RollerSpeedLimit',
    'RollerState',
    'Sample',
    'Settled',
    'ShapeBounds',
    'ShapeGuard',
    'ShapeMargins',
    'SimulatedRobot',
    'SolverError',
    'Status',
    'StructureError',
    'Tracking',
    'TrackingSettings',
    'TwistServo',
    'analyze_grasp',
    'deform',
    'find_resting_pose',
    'load_robot',
    'plan_grasps',
    'preset_names',
    'remaining_task',
    'settle',
    'shape_margins',
    'snug_center',
    'solve_twist',
    'solve_twist_ahead',
    'task_jacobian',
]
