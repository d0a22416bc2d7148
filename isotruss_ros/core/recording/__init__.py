# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Recording: cycles of the twist servo as texts, and decisions computed again from these.

Entry points: `recorded_servo.RecordedServo`, `recorded_cycle.read_cycle`, `repeated_run`.
Imports `core.servo` and the layers below it, not `core.paths`, planning or simulation.
"""
