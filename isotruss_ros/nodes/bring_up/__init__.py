# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes that bring up a robot: checks before it moves, and calibration."""
