# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The object is free: its equilibrium between the members that hold it, and how it slips."""
