"""Points that known laws and a generator of noise make, in the form of a file of measurements."""

from __future__ import annotations

from collections.abc import Iterator
import csv
from pathlib import Path

from isotruss_ros.core.power_law import Law, PowerLaw
from isotruss_ros.fit.measurements import COLUMNS, MODES, TRIAL
from isotruss_ros.paper.parameters import LENGTHS, PRESSURES, TRIALS, TUBE_DIAMETER
from isotruss_ros.paper.wrinkling import pressure_force, wrinkling_moment
import numpy as np

#: Points of each trial.
COUNT = 12
#: Standard deviation of the stiffness from trial to trial, and of the load, of its largest.
SCATTER, NOISE = 0.03, 0.01
#: Ends are pushed by at most this part of the force of the pressure, far from being pushed flat.
PUSH = 0.1


def write_points(laws: PowerLaw, path: Path, seed: int) -> None:
    """
    Write all pressures and lengths of the paper, five trials each, as `fit_tube_stiffness` reads.

    A trial has a stiffness and an offset of the load of its own, and every load noise.
    """
    random = np.random.default_rng(seed)
    with path.open('w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file)
        writer.writerow([*COLUMNS, TRIAL])
        for mode in MODES:
            law: Law = getattr(laws, mode)
            for pressure in PRESSURES:
                for length in LENGTHS:
                    writer.writerows(_trials(mode, law, pressure, length, random))


def _trials(
    mode: str, law: Law, pressure: float, length: float, random: np.random.Generator
) -> Iterator[list[object]]:
    stiffness = float(law.stiffness(np.array(length), np.array(pressure)))
    largest = largest_load(mode, pressure, length)
    for trial in range(TRIALS):
        softness = np.exp(-SCATTER * random.normal()) / stiffness
        displacements = np.linspace(0.0, largest * softness, COUNT)
        noise = NOISE * largest * (random.normal() + random.normal(size=COUNT))
        loads = np.linspace(0.0, largest, COUNT) + noise
        for x, load in zip(displacements, loads, strict=True):
            yield [mode, pressure, length, float(x), float(load), trial]


def largest_load(mode: str, pressure: float, length: float) -> float:
    """Return the load of the last point [N], rotary [N m]: where theory has the tube wrinkle."""
    radius = 0.5 * TUBE_DIAMETER
    if mode == 'axial':
        return PUSH * pressure_force(pressure, radius)
    moment = wrinkling_moment(pressure, radius)
    return moment if mode == 'rotary' else 2.0 * moment / length
