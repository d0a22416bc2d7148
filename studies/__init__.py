# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Benchmarks, the comparison with MuJoCo and the figures of the paper; not installed."""

from pathlib import Path
import sys

# Robots, rooms and plants are built by the helpers of the tests.
sys.path.append(str(Path(__file__).parents[1] / 'test' / 'helpers'))
