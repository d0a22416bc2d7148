# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Node `pick_and_place`: picking, moving and placing an object by actions of other nodes.

Entry point: `node`. Other modules: sequences as generators, and their steps by actions and
services. Imports `nodes.framework` and the core.
"""
