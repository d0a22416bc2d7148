# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rounding tolerances and iteration limits for all of the core."""

import numpy as np

#: Machine epsilon of double precision [-].
EPSILON = float(np.finfo(float).eps)
#: Smallest normal number of double precision, a positive lower bound of divisors [-].
SMALLEST_NORMAL = float(np.finfo(float).tiny)
#: Bound of rounding errors of a solution, relative or at unit scale [-, m, rad].
ROUNDING = 1e-9
#: Distance below which points coincide [m], and relative length below which vectors vanish [-]. It
#: is also the last step of Newton's method, whose error is the square of the step.
COINCIDENCE = 1e-12
#: Largest number of iterations of Newton's method [-]; quadratic convergence takes about five.
MAX_NEWTON_ITERATIONS = 50
