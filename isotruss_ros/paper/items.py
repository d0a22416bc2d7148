"""All items, in the order of the page."""

from __future__ import annotations

from isotruss_ros.paper import figure_4, figure_5, figure_6, figure_7, figure_9, parameters

ITEMS = (
    parameters.ITEM,
    figure_4.ITEM,
    figure_5.ITEM,
    figure_6.ITEM,
    figure_7.ITEM,
    figure_9.ITEM,
)
