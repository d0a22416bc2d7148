# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters that the paper states, in one table."""

from __future__ import annotations

from isotruss_ros.core import load_robot, Robot
from isotruss_ros.core.model.inflated_section import (
    END_SOFTENING,
    MEMBRANE_MODULUS,
    MEMBRANE_SHEAR_MODULUS,
)
from studies.paper.item import Advance, Report
from studies.paper.tables import number, Table

#: Parameters in SI units, rounded as in the paper.
TUBE_DIAMETER = 0.102
PRESSURES = (17.2e3, 34.5e3, 51.7e3)
LENGTHS = (0.254, 0.508, 0.762)
TRIALS = 5
#: Gauge pressure of the tests of Figs. 5 and 6 [Pa].
PRESSURE = 34.5e3
#: Fig. 5: lengths of the two equal edges and of the third [m].
EDGES = {'obtuse': (0.89, 1.28), 'equilateral': (1.02, 1.02), 'acute': (1.21, 0.64)}
#: Fig. 6: length of the tube, diameters of the cylinders and of the discs that represent them [m].
TUBE_LENGTH = 0.762
CYLINDERS = (0.0254, 0.102, 0.203)
DISCS = (0.127, 0.203, 0.305)
#: Depth of the cylinders where the paper states none [m].
DEPTH = 0.010
CENTIMETRE, KILOPASCAL = 0.01, 1e3


def compute(advance: Advance) -> Robot:
    """Return the robot with the parameters that the paper does not state."""
    robot = load_robot('triangle')
    advance(1.0)
    return robot


def report(robot: Robot) -> Report:
    """Return the table of all parameters."""
    return Report(
        heading='Section III-A: parameters',
        picture='',
        stated='A tube of 10.2 cm was tested at three pressures and three lengths, each '
        'combination five times.',
        computed='All parameters of the items below have the rounded values of the paper.',
        difference='None. Pressures are multiples of 2.5 psi and lengths multiples of 10 in. The '
        'discs of Fig. 6 have diameters of 5, 8 and 12 in; these are the sums of the diameters of '
        'cylinder and tube, to within 1 mm.',
        assumption='The paper does not state sizes and rigidity of the modules.',
        tables=(_stated(), _assumed(robot)),
    )


def _stated() -> Table:
    def listed(values: tuple[float, ...], unit: float) -> str:
        return ', '.join(number(value / unit) for value in values)

    rows = [
        ('tube diameter', listed((TUBE_DIAMETER,), CENTIMETRE), 'cm', 'III-A, III-B, III-C'),
        ('gauge pressures', listed(PRESSURES, KILOPASCAL), 'kPa', 'III-A'),
        ('member lengths', listed(LENGTHS, CENTIMETRE), 'cm', 'III-A'),
        ('trials of each combination', str(TRIALS), '', 'III-A'),
        ('gauge pressure', listed((PRESSURE,), KILOPASCAL), 'kPa', 'III-B, III-C'),
        *(
            (f'edges, {name} triangle', listed((a, a, b), CENTIMETRE), 'cm', 'Fig. 5')
            for name, (a, b) in EDGES.items()
        ),
        ('tube length', listed((TUBE_LENGTH,), CENTIMETRE), 'cm', 'III-C'),
        ('cylinder diameters', listed(CYLINDERS, CENTIMETRE), 'cm', 'III-C'),
        ('disc diameters of the model', listed(DISCS, CENTIMETRE), 'cm', 'III-C'),
    ]
    return Table(
        'parameters_stated',
        'Stated by the paper',
        ('parameter', 'value', 'unit', 'stated in'),
        rows,
        shown=False,
    )


def _assumed(robot: Robot) -> Table:
    module = robot.description.module
    rows = [
        ('pinch separation s', number(module.pinch_separation / CENTIMETRE), 'cm', 'preset'),
        ('connection rod h', number(module.rod_length / CENTIMETRE), 'cm', 'preset'),
        ('guide ring distance g', number(module.guide_ring_distance / CENTIMETRE), 'cm', 'preset'),
        ('EA of the rigid parts', number(module.axial_rigidity), 'N', 'preset'),
        ('EI of the rigid parts', number(module.flexural_rigidity), 'N m²', 'preset'),
        ('E t of the fabric', number(MEMBRANE_MODULUS), 'N/m', 'thin coated cloth'),
        ('G t of the fabric', number(MEMBRANE_SHEAR_MODULUS), 'N/m', 'thin coated cloth'),
        ('softening of the pinched ends c', number(END_SOFTENING), '', 'theory of a pillow'),
    ]
    return Table(
        'parameters_assumed',
        'Not stated, assumed here',
        ('parameter', 'value', 'unit', 'from'),
        rows,
    )
