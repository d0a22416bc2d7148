# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Node `pick_and_place`: picks, moves and places an object by actions of other nodes.

Entry point: `node`. Its other modules have the sequences as generators, whose steps are actions
and services. Imports `nodes.framework` and the core.
"""
