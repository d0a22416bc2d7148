# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Comparison of hypotheses about a measured run, each that one parameter deviates from the files.

Each hypothesis is fitted to the residuals by least squares with normal priors, besides errors of
the poses and the gauge that every hypothesis contains. Its evidence is twice the logarithm of the
Bayes factor against `NONE`, to first order about the fit: the decrease of chi-square, less a
penalty for parameters that could have explained other residuals as well (Kass and Raftery 1995).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
import math

from isotruss_ros.core import Uncertainty
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings
from isotruss_ros.core.holding.friction_range import FrictionRange
from isotruss_ros.core.numerics.arrays import Array, Flags
from isotruss_ros.identification.measured_run import MeasuredRun
from isotruss_ros.identification.residuals import find_loss, Residuals
from isotruss_ros.identification.rolled_run import Parameters, Prediction, Predictor
import numpy as np

NONE = 'none'
NAMES = ('friction', 'tube', 'offsets', 'pressure', 'delay', 'creep', 'mass')
#: Evidence from which on a hypothesis is named; Kass and Raftery call more than 10 very strong.
NAMED = 10.0
#: Evidence by which a hypothesis must surpass another one to be told apart; above 6 is strong.
APART = 6.0
#: Prior standard deviations of the delay of the poses [s], and of the error of a gauge [-].
DELAY, GAUGE = 0.1, 0.02
#: Number of iterations of the fit [-], and step of the differences in prior deviations [-].
ITERATIONS, STEP = 4, 0.02
#: Decrease of chi-square below which a fit has converged [-].
CONVERGED = 1.0
#: Largest posterior deviation of a determined parameter, relative to the prior one [-].
DETERMINED = 0.95


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """Fit of one hypothesis."""

    name: str
    estimate: Array  #: (p,) deviations from the files and settings, see `Parameters`
    deviation: Array  #: (p,) standard deviations of `estimate`
    evidence: float  #: evidence against `NONE`, see this module [-]
    is_determined: bool  #: whether the run determines a parameter better than the prior does
    #: deviation from the files from which on this run names a hypothesis with one parameter; NaN
    #: with several
    smallest: float


@dataclass(frozen=True, eq=False)
class ComparedRun:
    """Measured run beside the predictions of the model."""

    run: MeasuredRun
    nominal: Prediction  #: prediction with the parameters of the files
    fitted: Prediction  #: prediction of the hypothesis with the most evidence
    lost: int | None  #: last interval before the object was lost; None: it was held
    #: coefficients between which the contact history decides at the loss; None: unknown
    friction_range: FrictionRange | None
    hypotheses: Mapping[str, Hypothesis]  #: by name, in order of decreasing evidence
    deviations: Array  #: (p,) standard deviations if all parameters are fitted at once

    @property
    def named(self) -> str:
        """Return the name of the hypothesis with the most evidence, or `NONE`."""
        best = next(iter(self.hypotheses.values()))
        return best.name if best.evidence > NAMED else NONE

    @property
    def alike(self) -> tuple[str, ...]:
        """Return the names of other hypotheses with nearly the evidence of the named one."""
        if self.named == NONE:
            return ()
        best, *others = self.hypotheses.values()
        return tuple(
            other.name for other in others if other.evidence > max(best.evidence - APART, NAMED)
        )


def compare_run(run: MeasuredRun) -> ComparedRun:
    """
    Return the comparison of a measured run with the model.

    :raises RunError: the model has no equilibrium at the start of the run.
    """
    parts, prior = Parameters.of(run), find_prior(run)
    zero, predictor = np.zeros(parts.size), Predictor(run)
    nominal = predictor.at(zero)
    lost = find_loss(run, nominal)
    known = None
    if lost is not None and run.friction >= 0.0:
        known = predictor.friction_range(min(lost, nominal.count - 1))
    residuals = Residuals.of(run, nominal, lost, known)

    def residual(values: Array) -> Array:
        return residuals.at(predictor.at(values), values)

    base = residuals.at(nominal, zero)
    jacobian = np.zeros((len(base), parts.size))
    for k in np.flatnonzero(prior > 0.0):
        step = STEP * prior[k] * np.eye(parts.size)[k]
        jacobian[:, k] = (residual(step) - base) / step[k]
    always = np.zeros(parts.size, dtype=bool)
    always[parts.pose] = always[parts.gain] = True
    fits = {}
    for name in (NONE, *NAMES):
        free = always.copy()
        if name != NONE:
            free[getattr(parts, name)] = True
        fits[name] = fit(residual, base, jacobian, free & (prior > 0.0), prior)
    found = []
    for name, (estimate, deviation, score) in fits.items():
        own = slice(0, 0) if name == NONE else getattr(parts, name)
        is_determined = bool((deviation[own] < DETERMINED * prior[own]).any())
        evidence = score - fits[NONE][2]
        smallest = _smallest_named(deviation[own], prior[own])
        found.append(Hypothesis(name, estimate, deviation, evidence, is_determined, smallest))
    found.sort(key=lambda each: -each.evidence)
    fitted = predictor.at(found[0].estimate)
    _, together = _solve(jacobian, prior > 0.0, prior)
    by_name = {each.name: each for each in found}
    return ComparedRun(run, nominal, fitted, lost, known, by_name, together)


def _smallest_named(deviation: Array, prior: Array) -> float:
    """
    Return the deviation of a parameter (1,) at which the evidence is `NAMED`.

    A deviation d decreases chi-square by (d / deviation)^2, and a fitted parameter costs 2 log
    (prior / deviation) of evidence.
    """
    if len(deviation) != 1 or not deviation[0] > 0.0:
        return math.nan
    cost = 2.0 * math.log(float(prior[0] / deviation[0]))
    return float(deviation[0]) * math.sqrt(NAMED + cost)


def fit(
    residual: Callable[[Array], Array], base: Array, jacobian: Array, free: Flags, prior: Array
) -> tuple[Array, Array, float]:
    """
    Fit free parameters by Gauss-Newton steps with a constant Jacobian.

    :param residual: function of the parameters (p,) that returns residuals in deviations.
    :param base: residuals with zero parameters.
    :return: estimate (p,), standard deviations (p,), and twice the logarithm of the evidence.
    """
    columns, scale = jacobian[:, free] * prior[free], prior[free]
    information, deviations = _solve(jacobian, free, prior)
    values, rest = np.zeros(len(prior)), base
    best, least = values, np.inf
    for _ in range(ITERATIONS):
        shares = values[free] / scale
        cost = float(rest @ rest + shares @ shares)
        if cost >= least:
            break
        best, least = values, cost
        step = -np.linalg.solve(information, columns.T @ rest + shares)
        # Steps that hardly decrease the cost are not worth a prediction.
        if float(step @ information @ step) < CONVERGED:
            break
        values = values.copy()
        values[free] += scale * step
        rest = residual(values)
    return best, deviations, -least - float(np.linalg.slogdet(information)[1])


def _solve(jacobian: Array, free: Flags, prior: Array) -> tuple[Array, Array]:
    """Return the information in prior deviations, and posterior standard deviations (p,)."""
    columns = jacobian[:, free] * prior[free]
    information = np.eye(columns.shape[1]) + columns.T @ columns
    deviations = np.zeros(len(prior))
    deviations[free] = prior[free] * np.sqrt(np.diag(np.linalg.inv(information)))
    return information, deviations


def find_prior(run: MeasuredRun) -> Array:
    """Return the prior standard deviations (p,) of `Uncertainty`; zero without effect."""
    parts, told = Parameters.of(run), Uncertainty.of(run.robot, run.grip.body)
    prior = np.zeros(parts.size)
    prior[parts.friction] = told.friction_deviation
    prior[parts.tube] = prior[parts.creep] = told.stiffness
    prior[parts.offsets] = told.roller_offset
    if told.offset_covariance is not None:
        prior[parts.offsets] = np.sqrt(np.diag(told.offset_covariance))
    prior[parts.pressure] = told.pressure
    prior[parts.delay] = DELAY
    prior[parts.mass] = told.mass if run.grip.body.mass and run.gravity.any() else 0.0
    prior[parts.pose] = told.position, told.position, told.angle
    prior[parts.gain] = np.hypot(GAUGE, EstimatorSettings().squeeze_error)
    return prior
