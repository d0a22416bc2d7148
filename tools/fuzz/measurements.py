# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Fuzz the reader of measured points and the fit: each must return, or raise MeasurementError.

Run by `make fuzz`; a finding is run again by giving its file:

    .venv/bin/python tools/fuzz/measurements.py .fuzz/measurements/crash-...
"""

from __future__ import annotations

from pathlib import Path

import atheris

with atheris.instrument_imports(
    include=['isotruss_ros.core', 'isotruss_ros.cli.fit_tube_stiffness']
):
    from isotruss_ros.calibration.analysis import analyse
    from isotruss_ros.calibration.measurements import MeasurementError, read_measurements
    from isotruss_ros.calibration.report import block, unused_rows

from harness import fuzz_file


def read(path: Path) -> None:
    """Read, fit, and write the block for the robot file; a MeasurementError is no finding."""
    try:
        measurements = read_measurements(path)
    except MeasurementError:
        return
    analysis = analyse(measurements)
    list(unused_rows(analysis.unused, measurements.rows))
    if analysis.fitted is not None:
        block(analysis.fitted)


if __name__ == '__main__':
    fuzz_file(read, '.csv')
