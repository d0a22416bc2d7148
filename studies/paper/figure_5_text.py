# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Text of the page on Fig. 5."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math

from studies.paper.figure_5 import Shape
from studies.paper.item import Report
from studies.paper.tables import number, Table


def report(shapes: Mapping[str, Shape]) -> Report:
    """Return the stiffnesses with the reason of their order."""
    soft, _, stiff = shapes.values()
    total = sum(float(length) for length in soft.config.member_lengths)
    bars = [shape.truss / shape.stiffness for shape in shapes.values()]
    axial = [shape.stretching for shape in shapes.values()]
    sunk = [1e3 * shape.onset[0] for shape in shapes.values()]
    excess = [100 * shape.excess for shape in shapes.values()]
    largest = [float(shape.forces[-1]) for shape in shapes.values()]
    return Report(
        heading='Fig. 5: stiffness of a triangle in three shapes',
        picture='Left, the three triangles; right, force over displacement of the top up to the '
        'largest load, marked where a tube wrinkles',
        stated='A triangle of a 10.2 cm tube at 34.5 kPa was pushed down at its top, on a '
        'vertical track, until the tubes buckled. Model and measurements put the shapes in the '
        'same order.',
        computed='The steeper the legs, the stiffer the triangle: the acute one is '
        f'{number(stiff.stiffness / soft.stiffness, 2)} times as stiff as the obtuse one. '
        f'{number(100 * min(axial), 2)} to {number(100 * max(axial), 2)} % of the strain energy '
        'is axial. Two hinged bars with the legs’ axial stiffness k have the stiffness 2 k sin²α, '
        f'which is {number(100 * (min(bars) - 1), 2)} to {number(100 * (max(bars) - 1), 2)} % '
        'larger than ours, because they do not bend. A tube wrinkles at a displacement of '
        f'{number(min(sunk), 2)} to {number(max(sunk), 2)} mm. There the force of '
        'a linear model is larger, by '
        f'{_in_words(shapes, [f"{number(share, 2)} %" for share in excess])}. '
        'Without wrinkling, the triangle would bear at most '
        f'{_in_words(shapes, [f"{number(force)} N" for force in largest])} up to a displacement '
        'of 10 cm, where the curves are nearly level.',
        difference='The text of the paper does not say which shape is the stiffest.',
        assumption='Edges are measured between pinch points, so all shapes have '
        f'{number(100 * total)} cm of tube. The base modules are pinned at A. A tube wrinkles at '
        'the moment M = (p π r² − N) r/2, with the compression N (Comer and Levy, AIAA J. 1 '
        '(1963) 1652). Larger moments are not modelled.',
        tables=(_stiffnesses(shapes), _limits(shapes)),
    )


def _in_words(shapes: Mapping[str, Shape], values: Sequence[str]) -> str:
    """Return a value for each shape, with the name of the shape."""
    *others, last = (f'{value} ({name})' for name, value in zip(shapes, values, strict=True))
    return f'{", ".join(others)} and {last}'


def _stiffnesses(shapes: Mapping[str, Shape]) -> Table:
    rows = [
        (
            name,
            ', '.join(number(100 * edge) for edge in (shape.edges[0], *shape.edges)),
            number(math.degrees(shape.angle), 2),
            number(shape.stiffness),
            number(shape.truss),
            number(shape.axial),
            number(1e3 * shape.moment),
        )
        for name, shape in shapes.items()
    ]
    headings = (
        'shape',
        'edges [cm]',
        'leg α [deg]',
        'stiffness [N/m]',
        'two bars, 2 k sin²α [N/m]',
        'compression of a leg, per N on the top',
        'moment in a leg, per N on the top [mm]',
    )
    return Table('figure_5', 'Stiffness and what the legs carry', headings, rows)


def _limits(shapes: Mapping[str, Shape]) -> Table:
    rows = [
        (
            name,
            *(number(value, 3) for value in (1e3 * shape.onset[0], shape.onset[1])),
            *(number(value, 3) for value in (1e3 * shape.displacements[-1], shape.forces[-1])),
        )
        for name, shape in shapes.items()
    ]
    headings = ('shape', 'wrinkles [mm]', 'at [N]', 'drawn to [mm]', 'largest load [N]')
    caption = 'Where a tube wrinkles, and what the triangle bears'
    return Table('figure_5_limits', caption, headings, rows, shown=False)
