# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Figure of a measured run beside the predictions of the model."""

from __future__ import annotations

from pathlib import Path

from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.identification.hypotheses import ComparedRun, NONE
from matplotlib.figure import Figure
import numpy as np

#: Names of the pose's components, with the factor of the unit.
COMPONENTS = (('x [mm]', 1e3), ('y [mm]', 1e3), ('angle [deg]', np.degrees(1.0)))


def draw_run(compared: ComparedRun, path: Path) -> None:
    """
    Draw pose residuals, squeeze and friction over time, for the files and for the named cause.

    :param path: path of the file, whose extension selects the format.
    :raises MeasurementError: the file cannot be written.
    """
    run = compared.run
    used = slice(0, len(run.times) if compared.lost is None else compared.lost + 1)
    times = (run.times - run.times[0])[used]
    figure = Figure(figsize=(7.2, 7.2), layout='constrained')
    panels = figure.subplots(5, 1, sharex=True)
    models = [(compared.nominal, 'files', '-')]
    if compared.named != NONE:
        models.append((compared.fitted, f'with another {compared.named}', '--'))
    for model, name, line in models:
        for panel, (label, factor), column in zip(panels, COMPONENTS, range(3), strict=False):
            rest = factor * (run.poses - model.poses)[used, column]
            panel.plot(times, rest, line, color='black', lw=1.0, label=name)
            panel.set_ylabel(f'residual\n{label}')
        panels[3].plot(times, model.squeeze[used], line, color='black', lw=1.0)
        panels[4].plot(times, model.required[used], line, color='black', lw=1.0)
    panels[0].legend(frameon=False, fontsize='small')
    panels[3].plot(times, run.squeeze[used], '.', color='tab:blue', ms=4)
    panels[3].set_ylabel('squeeze [N]\ndots: gauge')
    panels[4].axhline(run.friction, color='tab:blue', lw=1.0)
    panels[4].set_ylabel('friction [-]\nblue: settings')
    panels[4].set_xlabel('time [s]')
    try:
        figure.savefig(path, dpi=130)
    except (OSError, ValueError) as error:
        raise MeasurementError(f'{path}: cannot be written: {error}') from error
