# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The demonstration: the real nodes as processes, Fig. 9 of the paper as twists, a picture.

Entry points: `python -m isotruss_ros.demo`, `view.main`.
Imports `core`, `nodes` and `plotting`.
"""
