# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Style of the figures: sizes for a printed page, accessible colours."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

#: Width of one column, and of a page with two columns [inch].
COLUMN, PAGE = 3.5, 7.16
#: Colours of Okabe and Ito, distinct for colour-blind readers and in grey.
BLUE, ORANGE, GREEN, BLACK = '#0072B2', '#D55E00', '#009E73', '#000000'
#: Colours of three values of one quantity, from light to dark.
STEPS = ('#7FBBE3', '#2B7BBA', '#08306B')
MARKERS = ('o', 's', '^')
GREY = '0.55'

#: Settings of matplotlib for all figures.
SETTINGS: dict[str, Any] = {
    'font.size': 8.0,
    'axes.titlesize': 8.0,
    'axes.labelsize': 8.0,
    'xtick.labelsize': 7.0,
    'ytick.labelsize': 7.0,
    'legend.fontsize': 7.0,
    'legend.frameon': False,
    'axes.linewidth': 0.6,
    'lines.linewidth': 1.2,
    'axes.spines.top': False,
    'axes.spines.right': False,
    'xtick.major.width': 0.6,
    'ytick.major.width': 0.6,
}
DOTS_PER_INCH = 200


def save(figure: Figure, path: Path) -> None:
    """Write a figure reproducibly, without metadata of the program."""
    figure.savefig(path, dpi=DOTS_PER_INCH, metadata={'Software': None})
