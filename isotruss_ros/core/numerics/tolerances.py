# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rounding tolerances and iteration caps shared by all of the core."""

import numpy as np

#: Machine epsilon of double precision [-].
EPSILON = float(np.finfo(float).eps)
#: Smallest normal number, a positive lower bound of divisors.
SMALLEST_NORMAL = float(np.finfo(float).tiny)
#: Bound of rounding errors of a solution, relative or at unit scale [-, m, rad].
ROUNDING = 1e-9
#: Distance below which points coincide [m], and relative length below which vectors vanish [-];
#: also the last step of Newton's method, whose error is the square of it.
COINCIDENCE = 1e-12
#: Iteration cap of Newton's method with quadratic convergence [-]; it takes about five.
MAX_NEWTON_ITERATIONS = 50
