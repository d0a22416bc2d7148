# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Data sets of random grasps, for learning.

Entry points: `grasp_dataset.write_dataset`, `random_grasps.draw_grasp`, `columns.COLUMNS`.
Imports `core`, and pyarrow for Parquet files.
"""
