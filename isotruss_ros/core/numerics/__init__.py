# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Arrays, factorisations, quadratic programs and base class of results, for the whole core.

Entry points: `qp.solve_qp`, `qp.find_nearest`, `factorization`, `arrays.finite_array`.
Imports `core.errors`.
"""
