# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node `calibration`, which fits roller offsets and tube stiffness to joint markers."""

from __future__ import annotations

import math
from pathlib import Path

from isotruss_msgs.srv import CalibrateStiffness
from isotruss_ros.calibration.home import calibrate_home
from isotruss_ros.calibration.home_fit import Posture
from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.calibration.robot_files import write_robot_file
from isotruss_ros.calibration.stiffness_scale import calibrate_stiffness, StiffnessCalibration
from isotruss_ros.core import IsotrussError, load_robot
from isotruss_ros.nodes.bring_up.joint_markers import (
    JointMarkers,
    MARKER_DEVIATION,
    MeasuredJoints,
    REST_TOLERANCE,
)
from isotruss_ros.nodes.framework.parameters import FixedSpec, ROBOT
from isotruss_ros.nodes.framework.runner import StoppableNode
import numpy as np

SPECS = (
    ROBOT,
    FixedSpec(
        'output',
        'calibrated_robot.yaml',
        'Robot file to be written; may be the file of the parameter `robot`',
    ),
    MARKER_DEVIATION,
)


class Calibration(StoppableNode):
    """Node that calibrates a robot without an object on request, and writes a robot file."""

    node_name = 'calibration'
    specs = SPECS

    def start(self) -> None:
        """Create the subscriptions and services."""
        self._robot = load_robot(self.values.robot)
        self._output = Path(self.values.output)
        self._markers = JointMarkers(self, self._robot)
        self._postures: list[Posture] = []
        self._stiffness: StiffnessCalibration | None = None
        self.offer('calibrate_home', self._calibrate_home)
        self.create_service(CalibrateStiffness, 'calibrate_stiffness', self._calibrate_stiffness)

    def _measure(self) -> MeasuredJoints:
        return self._markers.measure(self.now())

    def _calibrate_home(self) -> str:
        """Add the current posture, and fit the roller offsets to all postures so far."""
        posture, _ = self._measure()
        kept = [other for other in self._postures if not _is_same(other, posture)]
        self._postures = [*kept, posture]
        calibrated = calibrate_home(self._robot, self._postures, self.values.marker_deviation)
        write_robot_file(self._robot, self._output, calibrated, self._stiffness)
        offsets = zip(
            self._robot.roller_names, calibrated.offsets, calibrated.deviations, strict=True
        )
        said = ', '.join(f'{name} {1e3 * z:+.1f} +- {1e3 * sure:.1f}' for name, z, sure in offsets)
        return f'roller offsets [mm]: {said}; written to {self._output}'

    def _calibrate_stiffness(
        self, request: CalibrateStiffness.Request, response: CalibrateStiffness.Response
    ) -> CalibrateStiffness.Response:
        """Fit the stiffness to joint positions in one posture, with and without a known force."""
        try:
            under, count = self._measure()
            before = [other for other in self._postures if _is_same(other, under)]
            if not before:
                raise MeasurementError(
                    'this posture was not measured without the force: first call calibrate_home'
                )
            both = sorted(set(before[0].joints) & set(under.joints))
            home = calibrate_home(self._robot, self._postures, self.values.marker_deviation)
            fitted = calibrate_stiffness(
                self._robot.configuration(under.roller_positions + home.offsets),
                {request.joint: (request.force.x, request.force.y)},
                {name: before[0].joints[name] for name in both},
                {name: under.joints[name] for name in both},
                self.values.marker_deviation / math.sqrt(count),
            )
            write_robot_file(self._robot, self._output, home, fitted)
            self._stiffness = fitted
        except IsotrussError as error:
            response.message = str(error)
            return response
        response.success, (response.scale, response.deviation) = True, fitted
        response.message = (
            f'stiffness of the tubes relative to the model: {fitted.scale:.3f} +- '
            f'{fitted.deviation:.3f}; written to {self._output}'
        )
        return response


def _is_same(posture: Posture, other: Posture) -> bool:
    """Return whether the roller positions of two postures are equal."""
    return bool(
        np.abs(posture.roller_positions - other.roller_positions).max() < 2.0 * REST_TOLERANCE
    )
