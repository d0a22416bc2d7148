# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Parameters of the twist servo, applied when it is created and whenever they change."""

from __future__ import annotations

from dataclasses import replace
import math

from isotruss_ros.core import ShapeGuard, TwistServo
from isotruss_ros.core.safety.roller_failure import FailureCriterion, FailureDetector
from isotruss_ros.core.safety.shape_guard import ShapeBounds
from isotruss_ros.nodes.components import common_parameters as common
from isotruss_ros.nodes.framework import parameters as params
from isotruss_ros.nodes.framework.parameters import Spec

BOUNDS = ShapeBounds()
MIN_RIGIDITY = Spec(
    'min_rigidity', BOUNDS.min_rigidity, 'Least rigidity of the shape, 1 at home', (0.0, 0.99)
)
MIN_CLEARANCE = Spec(
    'min_clearance',
    BOUNDS.min_clearance,
    'Least distance between parts of the robot [m]',
    bounds=(0.0, 1.0),
)
MIN_OBJECT_CLEARANCE = Spec(
    'min_object_clearance',
    BOUNDS.min_object_clearance,
    'Least distance between the robot and the object, beside the grip [m]',
    bounds=(0.0, 1.0),
)
SLIDE_ALONG_LIMITS = Spec(
    'slide_along_limits', False, 'Slide along limits of lengths and shapes instead of stopping'
)
FAILED_ROLLERS = Spec('failed_rollers', [''], "Rollers t/j that are held at zero; [''] for none")
FAILURE_TIME = Spec(
    'failure_time',
    FailureCriterion().time,
    'A roller that is commanded 2 mm/s or more for this long and does not move has failed; '
    '0 for never [s]',
    bounds=(0.0, 60.0),
)
SPECS = (
    common.OBJECT_DIAMETER,
    common.GRIP_MODULE,
    common.GRIP,
    common.RATE,
    common.COMMAND_TIMEOUT,
    MIN_RIGIDITY,
    MIN_CLEARANCE,
    MIN_OBJECT_CLEARANCE,
    SLIDE_ALONG_LIMITS,
    FAILED_ROLLERS,
    FAILURE_TIME,
)


def apply_settings(servo: TwistServo, values: params.Parameters) -> None:
    """
    Set a servo's gains, bounds and limits, from its next cycle on.

    :param servo: of the node.
    :param values: parameters of the node.
    """
    servo.grip_module = common.select_grip_module(servo.robot, values[common.GRIP_MODULE])
    servo.members = common.named_members(values[common.GRIP])
    servo.object_diameter = values[common.OBJECT_DIAMETER]
    servo.period = 1.0 / values[common.RATE]
    servo.timeout = values[common.COMMAND_TIMEOUT]
    servo.slide_along_limits = values[SLIDE_ALONG_LIMITS]
    bounds = ShapeBounds(values[MIN_RIGIDITY], values[MIN_CLEARANCE], values[MIN_OBJECT_CLEARANCE])
    servo.guard = ShapeGuard(servo.robot, bounds)
    time = values[FAILURE_TIME] or math.inf  # 0 means never
    if servo.detector is None:
        criterion = FailureCriterion(time=time)
        servo.detector = FailureDetector(servo.robot.roller_names, criterion)
    elif servo.detector.criterion.time != time:
        # What was detected stays; what was measured by another criterion does not count.
        servo.detector.criterion = replace(servo.detector.criterion, time=time)
        servo.detector.reset(())
