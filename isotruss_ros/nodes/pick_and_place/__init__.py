# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The node `pick_and_place`: picks up, moves and places an object, by the actions of other nodes.

Entry point: `node`. Beside it are the sequences, as generators, and their steps over actions and
services. Imports `nodes.framework` and the core.
"""
