# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Benchmarks, the comparison with MuJoCo and the figures of the paper; not installed."""
