# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fit a tube to synthetic measurements of an assumed tube."""

from pathlib import Path
import tempfile

from isotruss_ros.calibration.beam_fit import end_stiffness
from isotruss_ros.cli.fit_tube_stiffness import main
from isotruss_ros.core.statics.tube_stiffness import InflatableBeam
from isotruss_ros.extras import explained_imports
import numpy as np

tube = InflatableBeam(
    radius=0.051, membrane_modulus=5e4, membrane_shear_modulus=8e3, end_softening=6.0
)
rows = ['mode,pressure,length,displacement,load']
for mode in ('axial', 'transverse', 'rotary'):
    for pressure in (17200.0, 34500.0, 51700.0):
        for length in (0.254, 0.508, 0.762):
            stiffness = float(end_stiffness(tube, mode, length, pressure))
            rows += [
                f'{mode},{pressure},{length},{d},{stiffness * d}'
                for d in np.linspace(0.0, 0.01, 9)
            ]
with explained_imports(), tempfile.TemporaryDirectory() as folder:
    points = Path(folder) / 'points.csv'
    points.write_text('\n'.join(rows))
    main([str(points), '--diameter', '0.102'])  # prints constants and the block for a robot file
