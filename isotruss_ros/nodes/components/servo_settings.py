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
from isotruss_ros.nodes.framework.parameters import Parameters, Spec

BOUNDS = ShapeBounds()
SPECS = (
    common.OBJECT_DIAMETER,
    common.GRIP_MODULE,
    common.GRIP,
    common.RATE,
    common.COMMAND_TIMEOUT,
    Spec(
        'min_rigidity', BOUNDS.min_rigidity, 'Least rigidity of the shape, 1 at home', (0.0, 0.99)
    ),
    Spec(
        'min_clearance',
        BOUNDS.min_clearance,
        'Least distance between parts of the robot [m]',
        (0.0, 1.0),
    ),
    Spec(
        'min_object_clearance',
        BOUNDS.min_object_clearance,
        'Least distance between the robot and the object, beside the grip [m]',
        (0.0, 1.0),
    ),
    Spec(
        'slide_along_limits', False, 'Slide along limits of lengths and shapes instead of stopping'
    ),
    Spec('failed_rollers', [''], "Rollers t/j that are held at zero; [''] for none"),
    Spec(
        'failure_time',
        FailureCriterion().time,
        'A roller that is commanded 2 mm/s or more for this long and does not move has failed; '
        '0 for never [s]',
        (0.0, 60.0),
    ),
)


def apply_settings(servo: TwistServo, values: Parameters) -> None:
    """
    Set a servo's gains, bounds and limits, from its next cycle on.

    :param servo: of the node.
    :param values: parameters of the node.
    """
    servo.grip_module = common.select_grip_module(servo.robot, values.grip_module)
    servo.members = common.named_members(values.grip)
    servo.object_diameter = values.object_diameter
    servo.period = 1.0 / values.rate
    servo.timeout = values.command_timeout
    servo.slide_along_limits = values.slide_along_limits
    bounds = ShapeBounds(values.min_rigidity, values.min_clearance, values.min_object_clearance)
    servo.guard = ShapeGuard(servo.robot, bounds)
    time = values.failure_time or math.inf  # 0 means never
    if servo.detector is None:
        criterion = FailureCriterion(time=time)
        servo.detector = FailureDetector(servo.robot.roller_names, criterion)
    elif servo.detector.criterion.time != time:
        # What was detected stays; what was measured by another criterion does not count.
        servo.detector.criterion = replace(servo.detector.criterion, time=time)
        servo.detector.reset(())
