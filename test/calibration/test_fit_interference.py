# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The fourth mode of `fit_tube_stiffness`: cylinders pressed into the side of the tube."""

from functools import cache

from isotruss_ros.calibration.local_fit import fit_local_stiffness
from isotruss_ros.calibration.measurements import MeasurementError, Presses, read_measurements
from isotruss_ros.calibration.pressed_tube import ClampedTube, press
from isotruss_ros.cli.fit_tube_stiffness import main
from isotruss_ros.core.contact.flattening import Flattening, flattening_of
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.model.robot_file import read_robot_file
from isotruss_ros.core.statics.section import InflatableBeam
from measured_points import HEADER, points, write
from nightly import some_now
import numpy as np
import pytest
import robots
from ruamel.yaml import YAML

RADIUS = 0.051
TUBE = InflatableBeam(RADIUS, 4e4, 1.5e4, 5.0)
CASES = [
    (pressure, length, cylinder, depth)
    for pressure in (2e4, 5e4)
    for length in (0.5, 0.8)
    for cylinder, depth in ((0.0254, 0.01), (0.2, 0.004))
]


@cache
def loads(factor):
    """Return the loads of all cases, of a tube that is so many times as stiff as the theory."""
    return np.array(
        [
            d * press(ClampedTube(TUBE, RADIUS, length, factor), p, 0.5 * length, c, d).stiffness
            for p, length, c, d in CASES
        ]
    )


def presses(values, cases=CASES):
    return Presses(*np.array(cases).T, values)


@pytest.mark.parametrize('factor', some_now([1.7, 0.4]))
def test_fit_of_loads_without_noise_returns_the_true_factor(factor):
    result = fit_local_stiffness(presses(loads(factor)), TUBE)
    assert result.value == pytest.approx(factor, rel=1e-6)
    assert result.count == len(CASES)


def test_loads_beyond_wrinkling_are_refused():
    # By hand: the wrinkling moment p pi R^3 / 2 is 4.17 N m at 20 kPa, and that is F L / 8.
    values = loads(1.7).copy()
    values[0] = 1.01 * 8.0 * (2e4 * np.pi * RADIUS**3 / 2.0) / 0.5
    with pytest.raises(MeasurementError, match=r'wrinkled at 1 of 8 .* wrinkles at 66\.7 N'):
        fit_local_stiffness(presses(values), TUBE)


def file_rows(values):
    """Return the rows of all four modes."""
    header, *others = points(TUBE)
    rows = [[*header, 'diameter'], *([*row, ''] for row in others)]
    for (pressure, length, cylinder, depth), load in zip(CASES, values, strict=True):
        rows.append(['interference', pressure, length, depth, float(load), 0, cylinder])
    return rows


def test_fitted_local_stiffness_scales_the_kernel_of_a_robot(tmp_path, capsys):
    path = write(tmp_path, file_rows(loads(1.7)))
    assert main([str(path), '--block', str(tmp_path / 'block.yaml')]) == 0
    assert 'local_stiffness: 1.7 of the theory' in capsys.readouterr().out
    document = robots.example()
    printed = (tmp_path / 'block.yaml').read_text(encoding='utf-8')
    document['tube'] |= YAML(typ='safe', pure=True).load(printed)
    description = read_robot_file(robots.write(document))
    assert description.local_stiffness == pytest.approx(1.7, rel=1e-5)
    robot = Robot(description)
    pressure, fabric = 34.5e3, InflatableBeam(RADIUS, 4e4, 1.5e4, 5.0).fabric
    theory = Flattening(0.5 * description.tube_diameter, pressure, fabric)
    result = flattening_of(robot, pressure).stiffness
    assert result == pytest.approx(1.7 * theory.stiffness, rel=1e-4)


@pytest.mark.parametrize(
    ('row', 'complaint'),
    [
        (['interference', 3e4, 0.5, -0.01, 1.0, 0.1], "displacement '-0.01': must be positive"),
        (['interference', 3e4, 0.5, 0.01, 0, 0.1], "load '0': must be positive"),
        (['interference', 3e4, 0.5, 0.01, 1.0, ''], "diameter '': must be a number"),
    ],
)
def test_invalid_rows_are_named(row, complaint, tmp_path):
    result = read_measurements(write(tmp_path, [[*HEADER, 'diameter'], row]))
    assert len(result.presses.loads) == 0
    (reason,) = result.unused
    assert complaint in reason
