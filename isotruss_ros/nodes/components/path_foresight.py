# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Refuse a path on which the held object would slip, before it moves."""

from __future__ import annotations

from isotruss_ros.core import ObjectPath, Robot
from isotruss_ros.core.control.inputs import Input, InputError, require_fresh
from isotruss_ros.core.errors import GraspError, PathError
from isotruss_ros.core.planning.foresee_path import foresee_grip
from isotruss_ros.nodes.components import common_parameters as common
from isotruss_ros.nodes.framework.parameters import Parameters
import numpy as np

SPECS = (common.OBJECT_DIAMETER, common.OBJECT, common.FRICTION)


def check_path(
    robot: Robot, values: Parameters, rollers: Input, path: ObjectPath, now: float
) -> None:
    """
    Check that the model of the held object can follow a path with the squeeze that it has.

    Without roller positions, or where no members hold the object as it is described at the
    beginning of the path, nothing is foreseen: what members push has no slip margin.

    :param robot: the robot.
    :param values: of `SPECS`.
    :param rollers: the measured state of the rollers.
    :param path: of the object.
    :param now: time on the clock of the inputs [s].
    :raises PathError: names the place where the path would end, and why.
    """
    try:
        (state,) = require_fresh(now, values[common.COMMAND_TIMEOUT], joint_states=rollers)
    except InputError:
        return
    body = common.read_body(values)
    friction = values[common.FRICTION] if body.friction is None else body.friction
    config = robot.configuration(state.value.positions)
    try:
        found = foresee_grip(config, body.moved_to(path.poses[0]), friction, path.poses)
    except GraspError:
        return
    if found is not None and found.why:
        x, y, angle = np.round(found.pose, 4).tolist()
        raise PathError(
            f'the path would end {100.0 * found.share:.0f} % of the way, at ({x:g}, {y:g}) m, '
            f'{angle:g} rad: {found.why}'
        )
