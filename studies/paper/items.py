# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""All items, in the order of the page."""

from __future__ import annotations

from studies.paper import (
    figure_4,
    figure_4_drawing,
    figure_5,
    figure_5_drawing,
    figure_5_text,
    figure_6,
    figure_6_drawing,
    figure_7,
    figure_7_drawing,
    figure_9,
    figure_9_drawing,
    parameters,
)
from studies.paper.item import Item

ITEMS = (
    Item('parameters', parameters.compute, parameters.report),
    Item('figure_4', figure_4.compute, figure_4.report, figure_4_drawing.draw),
    Item('figure_5', figure_5.compute, figure_5_text.report, figure_5_drawing.draw),
    Item('figure_6', figure_6.compute, figure_6.report, figure_6_drawing.draw),
    Item('figure_7', figure_7.compute, figure_7.report, figure_7_drawing.draw),
    Item('figure_9', figure_9.compute, figure_9.report, figure_9_drawing.draw),
)
