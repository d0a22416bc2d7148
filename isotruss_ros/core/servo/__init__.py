# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Servo loop: roller commands that execute a twist of object or joint, and control the squeeze.

Entry points: `twist_servo.TwistServo`, `squeeze_control.SqueezeControl`, `decision.Decision`.
Imports `core.estimation`, `core.safety` and the layers below them, not `core.paths` or planning.
"""
