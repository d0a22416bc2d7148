# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Fit of the constants of an inflatable beam to its axial, transverse and rotary end stiffness.

The constants are E t and G t of the fabric and the softening c of the pinched ends. They determine
all end stiffnesses at any length and pressure, see `InflatableBeam`. The logarithms of the
stiffnesses are fitted with equal weights.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, TYPE_CHECKING

from isotruss_ros.calibration.law import half_widths
from isotruss_ros.calibration.measurements import MeasurementError, MODES
from isotruss_ros.core.numerics.arrays import Array, Indices, MAX_MAGNITUDE
from isotruss_ros.core.statics.frame import local_stiffness
from isotruss_ros.core.statics.tube_stiffness import InflatableBeam, TubeStiffness
import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

#: Largest factor by which the search changes the constants from their initial estimate [-]; beyond
#: this factor the stiffnesses do not depend on a constant.
SEARCH_FACTOR = 1e6
#: Usual deviation of ln(stiffness) between trials of one tube, and smallest deviation of an
#: outlier [-]. With a third of the latter, correct groups of tubes that do not behave like this
#: beam are removed; with three times of it, groups that are wrong by a factor of 8 are not
#: removed.
COMMON_MISFIT, MIN_OUTLIER_MISFIT = 0.1, 0.7
#: Largest fraction of outlying groups [-]; if more are outlying, the model does not apply.
MAX_OUTLIER_SHARE = 0.2
#: Smallest singular value, relative to the largest, at which a combination of constants counts as
#: determined [-].
MIN_SINGULAR_RATIO = 1e-4


class BeamConstants(NamedTuple):
    """Constants of an inflatable beam, named as in a robot file."""

    membrane_modulus: float  #: E t of the fabric along the tube [N/m]
    membrane_shear_modulus: float  #: G t of the fabric [N/m]
    end_softening: float  #: c of the stiffness of the pinched ends [-]


@dataclass(frozen=True)
class FittedBeam:
    """Fitted inflatable beam, with 95 % confidence intervals of its constants."""

    radius: float  #: tube radius R [m]
    constants: BeamConstants  #: least-squares estimate
    low: BeamConstants  #: lower end of the confidence interval of each constant
    high: BeamConstants  #: upper ends; infinite if the points do not bound the constant
    misfits: Mapping[str, float]  #: root mean square of ln(measured / fitted stiffness) by mode

    @property
    def beam(self) -> InflatableBeam:
        """Return the model of the tube with the fitted constants."""
        return InflatableBeam(self.radius, *self.constants)


def end_stiffness(tube: TubeStiffness, mode: str, length: ArrayLike, pressure: ArrayLike) -> Array:
    """
    Return the stiffness at the end of a tube in one mode, a diagonal entry of (2).

    :param tube: stiffness model whose EI and GA do not depend on the length.
    :param mode: mode of the load, which is axial, transverse or rotary.
    :param length: (k,) lengths, measured between pinch points in the axial mode, and between guide
        rings in the other modes [m].
    :param pressure: (k,) gauge pressures [Pa].
    :return: (k,) stiffnesses [N/m], in the rotary mode [N m/rad].
    """
    length, pressure = np.broadcast_arrays(np.asarray(length, float), np.asarray(pressure, float))
    flat = length.ravel()
    place = MODES.index(mode)
    matrices = local_stiffness(flat, *tube.section_stiffness(flat, pressure.ravel()))
    return matrices[:, place, place].reshape(length.shape)


def fit_beam(
    modes: Indices, lengths: Array, pressures: Array, stiffnesses: Array, radius: float
) -> FittedBeam:
    """
    Fit the constants of an inflatable beam to end stiffnesses.

    :param modes: (n,) mode of each stiffness, as an index of `MODES`.
    :param lengths: (n,) lengths, measured between pinch points in the axial mode, and between
        guide rings in the other modes [m].
    :param pressures: (n,) gauge pressures [Pa].
    :param stiffnesses: (n,) end stiffnesses [N/m], in the rotary mode [N m/rad].
    :param radius: tube radius R [m].
    :raises MeasurementError: the points do not determine the constants; the message names the
        missing points.
    """
    tight = dict.fromkeys(('xtol', 'ftol', 'gtol'), 1e-14)
    solution = _search(modes, lengths, pressures, stiffnesses, radius, **tight)
    _require_determined(solution.jac)
    width = half_widths(solution.jac, solution.fun)
    # A constant without effect on the stiffnesses is unbounded.
    width = np.where(np.linalg.norm(solution.jac, axis=0) > MIN_SINGULAR_RATIO, width, np.inf)
    constants = np.exp(solution.x)
    if constants.max() > MAX_MAGNITUDE:
        raise MeasurementError(
            f'{BeamConstants._fields[constants.argmax()]} = {constants.max():g}: must be at most '
            f'{MAX_MAGNITUDE:g}, as in a robot file; are the units SI?'
        )
    with np.errstate(over='ignore'):
        low, high = np.exp(solution.x - width), np.exp(solution.x + width)
    misfits = {
        MODES[mode]: float(np.sqrt(np.mean(solution.fun[modes == mode] ** 2)))
        for mode in np.unique(modes)
    }
    best, least, most = (BeamConstants(*map(float, values)) for values in (constants, low, high))
    return FittedBeam(radius, best, least, most, misfits)


def outlying_ratios(
    modes: Indices, lengths: Array, pressures: Array, stiffnesses: Array, radius: float
) -> Array:
    """
    Find outliers, and return the ratios of their stiffnesses to the fitted beam's stiffnesses.

    The beam is fitted to all points with a Cauchy loss, which is robust against outliers.

    :param modes: (n,) index of each mode, see `fit_beam`.
    :param lengths: (n,) lengths, see `fit_beam` [m].
    :param pressures: (n,) gauge pressures [Pa].
    :param stiffnesses: (n,) end stiffnesses [N/m], in the rotary mode [N m/rad].
    :param radius: tube radius R [m].
    :return: (n,) ratios, which are 1 for points that are no outliers. All are 1 if more than the
        fraction `MAX_OUTLIER_SHARE` of the points are outliers.
    :raises MeasurementError: the points do not determine the constants.
    """
    robust = {'loss': 'cauchy', 'f_scale': COMMON_MISFIT}
    off = -_search(modes, lengths, pressures, stiffnesses, radius, **robust).fun
    out = np.abs(off) > MIN_OUTLIER_MISFIT
    return (
        np.exp(np.where(out, off, 0.0)) if out.mean() <= MAX_OUTLIER_SHARE else np.ones(len(off))
    )


def _search(
    modes: Indices,
    lengths: Array,
    pressures: Array,
    stiffnesses: Array,
    radius: float,
    **options: Any,
) -> OptimizeResult:
    """Return the least-squares fit of the constants' logarithms to those of the stiffnesses."""
    from scipy.optimize import least_squares

    _require_modes(modes)
    measured, target = (modes, lengths, pressures), np.log(stiffnesses)
    start, reach = _estimate(*measured, stiffnesses, radius), np.log(SEARCH_FACTOR)
    return least_squares(
        lambda logs: np.log(_stiffnesses(logs, *measured, radius)) - target,
        start,
        jac='3-point',
        bounds=(start - reach, start + reach),
        **options,
    )


def _stiffnesses(
    logs: Array, modes: Indices, lengths: Array, pressures: Array, radius: float
) -> Array:
    """Return the end stiffnesses (n,) of a beam with the constants exp(logs)."""
    beam = InflatableBeam(radius, *np.exp(logs))
    found = np.empty(len(modes))
    for mode in np.unique(modes):
        of_mode = modes == mode
        found[of_mode] = end_stiffness(beam, MODES[mode], lengths[of_mode], pressures[of_mode])
    return found


def _estimate(
    modes: Indices, lengths: Array, pressures: Array, stiffnesses: Array, radius: float
) -> Array:
    """Return initial estimates of the logarithms of the beam's constants."""
    axial, transverse, rotary = (modes == mode for mode in range(3))
    # Rotary stiffnesses are taken as 2 EI/L, between EI/L and 4 EI/L. Bending and shear have equal
    # shares of the compliance, as have the ends and the wall.
    bending = np.where(rotary, 0.5 * stiffnesses * lengths, stiffnesses * lengths**3 / 6.0)
    shear = np.where(rotary, 4.0 * stiffnesses / lengths, 2.0 * stiffnesses * lengths)
    across = transverse | rotary
    ends = 4.0 * stiffnesses[axial] / (pressures[axial] * radius)
    return np.log(
        [
            np.median(bending[across]) / (np.pi * radius**3),
            np.median(shear[across]) / (np.pi * radius),
            np.median(ends),
        ]
    )


def _require_modes(modes: Indices) -> None:
    missing = []
    if not (modes == 0).any():
        missing.append('no axial points: the softening of the pinched ends needs them')
    if not (modes > 0).any():
        missing.append('no transverse or rotary points: bending and shear need them')
    if not missing and len(modes) < 4:
        missing.append(
            f'{len(modes)} groups of points cannot check a fit of three constants; '
            'measure four or more'
        )
    if missing:
        raise MeasurementError('; '.join(missing))


def _require_determined(sensitivity: Array) -> None:
    """Raise MeasurementError if the points do not determine a combination of constants."""
    _, sizes, directions = np.linalg.svd(sensitivity)
    free = np.abs(directions[-1])
    # A single constant without effect is harmless: the stiffnesses fit for any value.
    if sizes[-1] < MIN_SINGULAR_RATIO * sizes[0] and free.max() < 0.99:
        names = ' and '.join(
            name for name, part in zip(BeamConstants._fields, free, strict=True) if part > 0.05
        )
        raise MeasurementError(
            f'{names} cannot be distinguished by these points; measure another length or mode'
        )
