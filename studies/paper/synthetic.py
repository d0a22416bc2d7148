# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Synthetic measurements of a known tube with noise."""

from __future__ import annotations

from collections.abc import Iterator
import csv
from pathlib import Path

from isotruss_ros.calibration.beam_fit import end_stiffness
from isotruss_ros.calibration.measurements import COLUMNS, MODES, TRIAL
from isotruss_ros.core.statics.tube_stiffness import TubeStiffness
import numpy as np
from studies.paper.default_tube import wrinkling_moment
from studies.paper.parameters import LENGTHS, PRESSURES, TRIALS, TUBE_DIAMETER

#: Number of points of each trial [-].
COUNT = 12
#: Standard deviation of the stiffness between trials, and of the load relative to its largest
#: value [-].
SCATTER, NOISE = 0.03, 0.01
#: Largest axial load relative to the force of the pressure [-], far from pushing the end flat.
PUSH = 0.1


def write_points(tube: TubeStiffness, path: Path, seed: int) -> None:
    """
    Write points for `fit_tube_stiffness`: five trials at each pressure and length of the paper.

    Each trial has its own stiffness and offset of the load; each load has noise.

    :param tube: stiffness model of the points.
    :param path: path of the file.
    :param seed: seed of the noise.
    """
    random = np.random.default_rng(seed)
    with path.open('w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file)
        writer.writerow([*COLUMNS, TRIAL])
        for mode in MODES:
            for pressure in PRESSURES:
                for length in LENGTHS:
                    writer.writerows(_trials(mode, tube, pressure, length, random))


def _trials(
    mode: str, tube: TubeStiffness, pressure: float, length: float, random: np.random.Generator
) -> Iterator[list[object]]:
    stiffness = float(end_stiffness(tube, mode, length, pressure))
    largest = largest_load(mode, pressure, length)
    for trial in range(TRIALS):
        softness = np.exp(-SCATTER * random.normal()) / stiffness
        displacements = np.linspace(0.0, largest * softness, COUNT)
        noise = NOISE * largest * (random.normal() + random.normal(size=COUNT))
        loads = np.linspace(0.0, largest, COUNT) + noise
        for x, load in zip(displacements, loads, strict=True):
            yield [mode, pressure, length, float(x), float(load), trial]


def largest_load(mode: str, pressure: float, length: float) -> float:
    """Return the load at wrinkling [N], rotary [N m], at which a trial ends."""
    radius = 0.5 * TUBE_DIAMETER
    if mode == 'axial':
        return PUSH * pressure * np.pi * radius**2
    moment = wrinkling_moment(pressure, radius)
    return moment if mode == 'rotary' else 2.0 * moment / length
