# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The loop that commands the rollers: twist of the object or a joint, and the squeeze of the grip.

Entry points: `twist_servo.TwistServo`, `squeeze_control.SqueezeControl`, `decision.Decision`.
Imports `core.estimation`, `core.safety` and what is below them, not `core.paths` or planning.
"""
