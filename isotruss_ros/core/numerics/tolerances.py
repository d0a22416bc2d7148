# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rounding tolerances and iteration limits for the whole core."""

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
#: Fraction of a quantity that is negligible [-]: difference of equal values, residual of a
#: balance, weight of a regularisation that makes a solution unique.
NEGLIGIBLE_SHARE = 1e-6
#: Largest condition number of a structure [-]; beyond it the structure is a mechanism in double
#: precision. A hundredth of it refuses structures that deflect by some metres per newton.
MAX_CONDITION = 1e12
#: Largest number of iterations of Newton's method and of continuation [-]. In 400 random calls,
#: 29 iterations were the most, and about five were usual; with a third of this limit, one
#: equilibrium in thirty is not found.
MAX_NEWTON_ITERATIONS = 50
#: Largest number of steps that each solve a whole problem (linearisations, changes of contacts,
#: corrections of a waypoint), and of iterations that must end within a control cycle [-].
MAX_SEARCH_STEPS = 12
