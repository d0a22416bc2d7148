# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of measured points of a tube that is known."""

import csv

from isotruss_ros.calibration.measurements import MODES
from isotruss_ros.core.statics.section import InflatableBeam
import numpy as np

# The paper's pressures and lengths.
PRESSURES = (17.2e3, 34.5e3, 51.7e3)
LENGTHS = (0.254, 0.508, 0.762)
RADIUS = 0.051
CONSTANTS = {'membrane_modulus': 4e4, 'membrane_shear_modulus': 1.5e4, 'end_softening': 5.0}
TUBE = InflatableBeam(RADIUS, **CONSTANTS)
RANGES = {'axial': 0.03, 'transverse': 0.08, 'rotary': 0.35}
HEADER = ['mode', 'pressure', 'length', 'displacement', 'load']


def stiffness(mode, length, pressure, tube=TUBE):
    """Return the end stiffness of a tube, by the closed forms of clamped beams."""
    EA, EI, GA = (float(value[0]) for value in tube.section_stiffness([length], pressure))
    transverse = 1.0 / (length**3 / (12.0 * EI) + length / GA)
    rotary = EI / length + 0.25 * length**2 * transverse
    return {'axial': EA / length, 'transverse': transverse, 'rotary': rotary}[mode]


def points(tube=TUBE, noise=0.0, trials=1, count=12, bend=1.0, softer=1.0, seed=0):
    """Return the rows of a CSV file, times `softer` beyond a share `bend` of the range."""
    rng = np.random.default_rng(seed)
    rows = [[*HEADER, 'trial']]
    for mode in MODES:
        for pressure in PRESSURES:
            for length in LENGTHS:
                for trial in range(trials):
                    k = stiffness(mode, length, pressure, tube)
                    x = np.linspace(0.0, RANGES[mode], count)
                    corner = bend * RANGES[mode]
                    load = k * (np.minimum(x, corner) + softer * np.maximum(x - corner, 0.0))
                    load += noise * k * RANGES[mode] * (rng.normal(size=count) + rng.normal())
                    rows += [
                        [mode, pressure, length, float(a), float(b), trial]
                        for a, b in zip(x, load, strict=True)
                    ]
    return rows


def write(folder, rows):
    path = folder / 'points.csv'
    with path.open('w', newline='', encoding='utf-8') as file:
        csv.writer(file).writerows(rows)
    return path
