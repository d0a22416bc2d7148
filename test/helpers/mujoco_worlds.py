# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tests that need MuJoCo are skipped where it is not installed."""

import importlib.util

import pytest

needs_mujoco = pytest.mark.skipif(
    importlib.util.find_spec('mujoco') is None,
    reason='MuJoCo is not installed: pip install mujoco (make venv does)',
)
