# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Columns of a data set of grasps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from isotruss_ros import core
from isotruss_ros.core.errors import suggest
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.dataset.random_grasps import CORNER_COUNTS, DatasetError, RandomGrasp
import numpy as np
from numpy.typing import NDArray

#: Number of directions in which the support function of an object is computed [-].
DIRECTIONS = 16
#: `hold` of a grasp without a structural model.
NO_STRUCTURE = 'NO_STRUCTURE'


class Column(NamedTuple):
    """Column of a data set, with one value or one row of values for each grasp."""

    kind: str  #: data type of NumPy
    axis: str  #: number of values for each grasp: a number or a name, empty for one value
    unit: str  #: unit of the values
    words: str  #: quantity


#: Columns by their names: first the arguments of the grasps, then the results of `settle_grasps`.
COLUMNS = {
    'number': Column('i8', '', '-', 'number of the grasp; with the seed, it determines the row'),
    'item': Column('i8', '', '-', 'index of the kind or object in the option --objects'),
    'shape': Column('U8', '', '-', 'disc, polygon, ellipse, or other'),
    'semi_axes': Column(
        'f8', '2', 'm', 'semi-axes of an ellipse, radii of a disc; NaN for other shapes'
    ),
    'corner_x': Column('f8', 'corners', 'm', "x of a polygon's vertices, in its frame; then NaN"),
    'corner_y': Column('f8', 'corners', 'm', "y of a polygon's vertices, in its frame; then NaN"),
    'corner_radii': Column('f8', 'corners', 'm', "radii of a polygon's corners; then NaN"),
    'support': Column(
        'f8',
        str(DIRECTIONS),
        'm',
        f'distances of the tangents from the origin of the object, in {DIRECTIONS} equally spaced '
        'directions from its x axis, counter-clockwise',
    ),
    'roller_positions': Column('f8', 'rollers', 'm', 'travel of the rollers since home'),
    'given_pose': Column('f8', '3', 'm, m, rad', 'given pose (x, y, angle) of the object'),
    'friction': Column('f8', '', '-', 'coefficient of friction'),
    'external_wrench': Column('f8', '3', 'N, N, N m', 'external wrench (fx, fy, m)'),
    'held': Column('?', '', '-', 'whether the object is held'),
    'hold': Column(
        'U16', '', '-', f'name of the HoldStatus; {NO_STRUCTURE} without a structural model'
    ),
    'slip_margin': Column('f8', '', 'N', 'slip margin, negative without an equilibrium'),
    'squeeze': Column('f8', '', 'N', 'mean normal force of the grasping members'),
    'required_friction': Column('f8', '', '-', 'smallest friction without slip; may be infinite'),
    'pose': Column('f8', '3', 'm, m, rad', 'pose of the object in equilibrium'),
    'displacement': Column('f8', '3', 'm, m, rad', 'pose minus given pose'),
    'normal_forces': Column('f8', 'members', 'N', 'normal forces of the members'),
    'friction_forces': Column(
        'f8', 'members', 'N', 'friction of the members on the object, counter-clockwise'
    ),
    'utilisation': Column(
        'f8', 'members', '-', 'ratios of bending moment to wrinkling moment of the members'
    ),
}


def check_columns(names: Sequence[str]) -> tuple[str, ...]:
    """Return checked names of columns, without repetition; none: all columns."""
    for name in names:
        if name not in COLUMNS:
            hint = suggest(name, COLUMNS)
            raise DatasetError(f'column {name!r}: {hint}must be one of {", ".join(COLUMNS)}')
    return tuple(dict.fromkeys(names)) or tuple(COLUMNS)


def corner_count(objects: Sequence[Any]) -> int:
    """Return the width of the columns of corners for kinds and objects of a distribution."""
    shapes = [item.shape for item in objects if not isinstance(item, str)]
    counts = [len(shape.vertices) for shape in shapes if isinstance(shape, core.Polygon)]
    return max(CORNER_COUNTS[1], *counts, 0)


def compute_columns(
    robot: core.Robot, grasps: Sequence[RandomGrasp], first: int, corners: int
) -> dict[str, NDArray[Any]]:
    """Settle grasps, the first of which has a number; return all columns by their names."""
    configs, bodies, friction, wrenches, items = zip(*grasps, strict=True)
    settled = core.settle_grasps(list(configs), list(bodies), friction, np.array(wrenches))
    shapes = [body.shape for body in bodies]
    outlines = np.array([_outline(shape, corners) for shape in shapes])
    directions = np.exp(2j * np.pi * np.arange(DIRECTIONS) / DIRECTIONS)
    values = {
        'number': np.arange(first, first + len(grasps)),
        'item': items,
        'shape': [_kind_name(shape) for shape in shapes],
        'semi_axes': [_semi_axes(shape) for shape in shapes],
        'corner_x': outlines[:, 0],
        'corner_y': outlines[:, 1],
        'corner_radii': outlines[:, 2],
        'support': [shape.support(directions) for shape in shapes],
        'roller_positions': [config.roller_positions for config in configs],
        'given_pose': [body.pose for body in bodies],
        'friction': friction,
        'external_wrench': wrenches,
        'hold': [NO_STRUCTURE if hold is None else hold.name for hold in settled.hold],
    }
    for name in COLUMNS.keys() - values.keys():
        value = getattr(settled, name)
        is_table = isinstance(value, dict)
        values[name] = np.array(list(value.values())).T if is_table else value
    return {name: np.asarray(values[name], dtype=column.kind) for name, column in COLUMNS.items()}


def _kind_name(shape: Shape) -> str:
    """Return the value of the column `shape`."""
    kinds = {core.Disc: 'disc', core.Polygon: 'polygon', core.Ellipse: 'ellipse'}
    return kinds.get(type(shape), 'other')


def _semi_axes(shape: Shape) -> tuple[float, float]:
    """Return the semi-axes of a disc or an ellipse [m], NaN for other shapes."""
    if isinstance(shape, core.Disc):
        return 0.5 * shape.diameter, 0.5 * shape.diameter
    return shape.semi_axes if isinstance(shape, core.Ellipse) else (np.nan, np.nan)


def _outline(shape: Shape, corners: int) -> Array:
    """Return x, y and radii of the corners of a polygon (3, corners), filled up by NaN [m]."""
    rows = np.full((3, corners), np.nan)
    if isinstance(shape, core.Polygon):
        count = len(shape.vertices)
        rows[:2, :count] = np.array(shape.vertices).T
        rows[2, :count] = shape.radii
    return rows
