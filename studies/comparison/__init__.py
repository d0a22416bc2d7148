# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Comparison of our model with MuJoCo: `make plant` writes docs/plant.md."""
