# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Node `pick_and_place`, which picks, moves and places an object by actions of other nodes.

Entry point: `node`. Its other modules contain the sequences, which are generators with actions and
services as steps. Imports `nodes.framework` and the core.
"""
