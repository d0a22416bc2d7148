# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Table I and Fig. 4: stiffness of the default tube, and its recovery by a fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
import tempfile

from isotruss_ros.calibration.analysis import analyse, Analysis
from isotruss_ros.calibration.law import fit_law, FittedLaw
from isotruss_ros.calibration.measurements import MODES, read_measurements
from isotruss_ros.calibration.report import SYMBOLS, UNITS
from isotruss_ros.core.numerics.arrays import Array
import numpy as np
from studies.paper.default_tube import default_tube, end_stiffnesses
from studies.paper.item import Advance, Report
from studies.paper.parameters import LENGTHS, PRESSURES
from studies.paper.synthetic import NOISE, SCATTER, write_points
from studies.paper.tables import number, Table

#: Seed of the data set that is shown, and number of further data sets that test the intervals [-].
SEED, REPEATS = 0, 50


@dataclass(frozen=True)
class TubeFit:
    """
    Data of Table I and Fig. 4.

    :ivar theory: end stiffnesses (3 pressures, 3 lengths) of the default tube in each mode.
    :ivar laws: power law closest to the theory in each mode.
    :ivar analysis: result of `fit_tube_stiffness` for one set of synthetic points.
    :ivar held: fraction of the constants of other data sets that are inside their intervals.
    """

    theory: Mapping[str, Array]
    laws: Mapping[str, FittedLaw]
    analysis: Analysis
    held: float


def compute(advance: Advance, repeats: int = REPEATS) -> TubeFit:
    """
    Compute the power laws and the fits.

    :param advance: callback that receives the completed fraction of the work.
    :param repeats: number of further data sets that test the intervals.
    """
    pressures, lengths = np.meshgrid(PRESSURES, LENGTHS, indexing='ij')
    theory = end_stiffnesses(pressures, lengths)
    laws = {
        mode: fit_law(pressures.ravel(), lengths.ravel(), theory[mode].ravel()) for mode in MODES
    }
    held = []
    for repeat in range(repeats):
        held.append(inside(fit_points(SEED + 1 + repeat)))
        advance((repeat + 1) / (repeats + 1))
    analysis = fit_points(SEED)
    advance(1.0)
    return TubeFit(theory, laws, analysis, float(np.mean(held)))


def fit_points(seed: int) -> Analysis:
    """
    Return the result of `fit_tube_stiffness` for synthetic points of the default tube.

    :param seed: seed of the noise.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'points.csv'
        write_points(default_tube(), path, seed)
        return analyse(read_measurements(path))


def inside(analysis: Analysis) -> list[bool]:
    """
    Return for each constant whether its interval contains the true value.

    :param analysis: analysis of synthetic points.
    """
    fitted, tube = analysis.fitted, default_tube()
    return [
        low <= getattr(tube, name) <= high
        for name, low, high in zip(SYMBOLS, fitted.low, fitted.high, strict=True)
    ]


def report(result: TubeFit) -> Report:
    """
    Return Table I and the accuracy of the fit.

    :param result: result of `compute`.
    """
    held = inside(result.analysis)
    return Report(
        heading='Table I and Fig. 4: stiffness of the tube',
        picture='Above, load against displacement of a member of 50.8 cm in three modes, at three '
        'pressures; below, stiffness over length',
        stated='A power law of pressure and length is fitted to the measured stiffness of each '
        'mode; Table I lists C, b and R².',
        computed='The figure shows the theory of the default tube at the nine combinations, and '
        'the nearest power laws. `fit_tube_stiffness` fitted one beam to five trials of each '
        f'combination with random errors: {100 * SCATTER:g} % of the stiffness, {100 * NOISE:g} % '
        'of the largest load, and an offset of the load. '
        f'The true values of {sum(held)} of its {len(held)} constants are inside the fitted 95 % '
        'intervals.',
        difference='None can be stated without the measured values. Power laws of single modes '
        f'deviate from the theory by up to {number(100 * _misfit(result), 2)} %. No beam '
        f'has both the transverse and the rotary law {_limit(result)} at '
        f'{number(1e-3 * PRESSURES[1])} kPa, so a robot file contains the constants of a beam. In '
        f'{REPEATS} further fits, {number(100 * result.held)} % of the 95 % intervals contained '
        'the true value.',
        assumption='The fabric is assumed, so the exponents are not those of the paper. The '
        'points end where the tube wrinkles; axial points end at a tenth of the pressure force.',
        tables=(_laws(result), _fits(result)),
    )


def _limit(result: TubeFit) -> str:
    """Return the length beyond which no beam fulfils the power laws."""
    transverse, rotary = (result.laws[mode].law for mode in ('transverse', 'rotary'))
    # 12 k_rotary / (k_transverse L^2), a power law too, is at least 4 for a beam.
    at_one_metre = 12.0 * float(
        rotary.stiffness(np.array(1.0), np.array(PRESSURES[1]))
        / transverse.stiffness(np.array(1.0), np.array(PRESSURES[1]))
    )
    slope = rotary.b - transverse.b - 2.0
    return f'above {number((4.0 / at_one_metre) ** (1.0 / slope), 2)} m'


def _misfit(result: TubeFit) -> float:
    """Return the largest misfit of a law against the theory."""
    pressures, lengths = np.meshgrid(PRESSURES, LENGTHS, indexing='ij')
    return max(
        float(np.abs(result.laws[mode].law.stiffness(lengths, pressures) / k - 1.0).max())
        for mode, k in result.theory.items()
    )


def _laws(result: TubeFit) -> Table:
    rows = []
    for mode in MODES:
        fitted, k = result.laws[mode], result.theory[mode]
        rows.append(
            (
                f'{mode} [{UNITS[mode]}]',
                number(fitted.law.C, 4),
                number(fitted.law.a),
                number(fitted.law.b),
                f'{fitted.r_squared:.3f}',
                number(k[0, 0]),
                number(k[1, 1]),
                number(k[2, 2]),
            )
        )
    places = (
        f'{number(p / 1e3)} kPa, {number(100 * length)} cm'
        for p, length in zip(PRESSURES, LENGTHS, strict=True)
    )
    return Table(
        'table_1',
        'Table I of the default tube, k = C pᵃ Lᵇ in SI units, and its theory at three places',
        ('mode', 'C', 'a', 'b', 'R²', *(f'k at {place}' for place in places)),
        rows,
    )


def _fits(result: TubeFit) -> Table:
    fitted, tube = result.analysis.fitted, default_tube()
    rows = []
    for name, value, low, high in zip(
        SYMBOLS, fitted.constants, fitted.low, fitted.high, strict=True
    ):
        constant = getattr(tube, name)
        rows.append(
            (
                f'{name}, {SYMBOLS[name]}',
                number(constant, 4),
                number(value, 4),
                f'{number(low, 4)} to {number(high, 4)}',
                'yes' if low <= constant <= high else 'no',
            )
        )
    return Table(
        'table_1_fit',
        'Constants of the synthetic points, and those fitted by `fit_tube_stiffness`',
        ('constant', 'made with', 'fitted', '95 % interval', 'inside'),
        rows,
        shown=False,
    )
