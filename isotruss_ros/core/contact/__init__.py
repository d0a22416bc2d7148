# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Contact of objects with inflated tubes: flattening, dents and the wrench space of contacts.

Entry points: `dents.dent_table`, `wrench_space.wrench_space`.
Imports `core.statics` and the layers below it.
"""
