# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Demonstration: the nodes as processes, the path of the paper's Fig. 9 as twists, and a picture.

Entry points: `python -m isotruss_ros.demo`, `view.main`.
Imports `core`, `nodes` and `plotting`.
"""
