# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The analysis of the measured grasp: when inputs allow it, and by which code it is reported."""
