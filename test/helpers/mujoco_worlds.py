"""Tests that need MuJoCo are skipped where it is not installed."""

import importlib.util

import pytest

needs_mujoco = pytest.mark.skipif(
    importlib.util.find_spec('mujoco') is None,
    reason='MuJoCo is not installed: pip install mujoco (make venv does)',
)
