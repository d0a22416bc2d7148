# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The fit of stiffness laws and of pressed cylinders: constants, output and refusals."""

import csv
from functools import cache
from pathlib import Path
import re

from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.calibration import measurements
from isotruss_ros.calibration.beam_fit import fit_beam
from isotruss_ros.calibration.law import fit_law
from isotruss_ros.calibration.local_fit import fit_local_stiffness
from isotruss_ros.calibration.pressed_tube import ClampedTube, press
from isotruss_ros.cli.fit_tube_stiffness import main
from isotruss_ros.core.contact.pressed_skin import Flattening, flattening_of
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.model.robot_file import read_robot_file
from isotruss_ros.core.model.stiffness_law import Law
from isotruss_ros.core.statics.tube_stiffness import InflatableBeam, tube_stiffness
from nightly import some_now
import numpy as np
import pytest
import robots
from ruamel.yaml import YAML
from scipy.optimize import curve_fit
from scipy.stats import t as t_distribution

PRESSURES = (17.2e3, 34.5e3, 51.7e3)
LENGTHS = (0.254, 0.508, 0.762)
RADIUS = 0.051
CONSTANTS = {'membrane_modulus': 4e4, 'membrane_shear_modulus': 1.5e4, 'end_softening': 5.0}
TUBE = InflatableBeam(RADIUS, **CONSTANTS)
RANGES = {'axial': 0.03, 'transverse': 0.08, 'rotary': 0.35}
HEADER = ['mode', 'pressure', 'length', 'displacement', 'load']
LAW = Law(0.5, 0.9, -0.2)


def stiffness(mode, length, pressure, tube=TUBE):
    """Return the end stiffness of a tube, by the closed forms of clamped beams."""
    EA, EI, GA = (float(value[0]) for value in tube.section_stiffness([length], pressure))
    transverse = 1.0 / (length**3 / (12.0 * EI) + length / GA)
    rotary = EI / length + 0.25 * length**2 * transverse
    return {'axial': EA / length, 'transverse': transverse, 'rotary': rotary}[mode]


def points(tube=TUBE, noise=0.0, trials=1, count=12, bend=1.0, softer=1.0, seed=0):
    """Return the rows of a CSV file, times `softer` beyond a share `bend` of the range."""
    rng = np.random.default_rng(seed)
    rows = [[*HEADER, 'trial']]
    for mode in measurements.MODES:
        for pressure in PRESSURES:
            for length in LENGTHS:
                for trial in range(trials):
                    k = stiffness(mode, length, pressure, tube)
                    x = np.linspace(0.0, RANGES[mode], count)
                    corner = bend * RANGES[mode]
                    load = k * (np.minimum(x, corner) + softer * np.maximum(x - corner, 0.0))
                    load += noise * k * RANGES[mode] * (rng.normal(size=count) + rng.normal())
                    rows += [
                        [mode, pressure, length, float(a), float(b), trial]
                        for a, b in zip(x, load, strict=True)
                    ]
    return rows


def write(folder, rows):
    path = folder / 'points.csv'
    with path.open('w', newline='', encoding='utf-8') as file:
        csv.writer(file).writerows(rows)
    return path


def run(capsys, path, *options):
    """Return exit code, output and complaints."""
    code = main([str(path), *map(str, options)])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def accepted(text):
    """Return the model that the robot-file reader makes of a printed block."""
    (printed,) = re.findall(r'^  stiffness:.*(?:\n    .+)+', text, re.MULTILINE)
    document = robots.example()
    document['tube'] |= YAML(typ='safe', pure=True).load(printed)
    return tube_stiffness(read_robot_file(robots.write(document))).model


def constants(model):
    return [getattr(model, name) for name in CONSTANTS]


def grid():
    """Return modes, lengths and pressures of all groups of the paper."""
    modes, pressures, lengths = np.meshgrid(range(3), PRESSURES, LENGTHS, indexing='ij')
    return modes.ravel(), lengths.ravel(), pressures.ravel()


def measured(modes, lengths, pressures, tube=TUBE):
    cases = zip(modes, lengths, pressures, strict=True)
    return np.array([stiffness(measurements.MODES[mode], L, p, tube) for mode, L, p in cases])


@robots.examples(30)
@given(st.floats(3.0, 6.0), st.floats(3.0, 6.0), st.floats(-0.5, 2.0), st.floats(0.02, 0.2))
def test_constants_of_any_tube_are_recovered_by_the_fit(wall, shear, ends, radius):
    tube = InflatableBeam(radius, 10.0**wall, 10.0**shear, 10.0**ends)
    case = grid()
    fitted = fit_beam(*case, measured(*case, tube), radius)
    # A constant that hardly acts is hardly known; what it does is.
    assert max(fitted.misfits.values()) < 1e-7


def test_constants_of_a_wider_tube_are_fitted_with_its_diameter(tmp_path, capsys):
    path = write(tmp_path, points(InflatableBeam(0.08, **CONSTANTS)))
    _, out, _ = run(capsys, path, '--diameter', 0.16)
    assert constants(accepted(out)) == pytest.approx(list(CONSTANTS.values()), rel=1e-6)


def test_fit_is_the_joint_least_squares_solution_of_all_modes():
    rng = np.random.default_rng(5)
    case = grid()
    k = measured(*case) * np.exp(0.1 * rng.normal(size=27))
    fitted = fit_beam(*case, k, RADIUS)

    def model(_, *logs):
        return np.log(measured(*case, InflatableBeam(RADIUS, *np.exp(logs))))

    best, covariance = curve_fit(model, None, np.log(k), p0=np.log(list(CONSTANTS.values())))
    reach = t_distribution.ppf(0.975, 24) * np.sqrt(np.diag(covariance))
    pairs = (fitted.constants, best), (fitted.low, best - reach), (fitted.high, best + reach)
    for result, expected in pairs:
        assert np.log(result) == pytest.approx(expected, rel=1e-4)


def test_fit_against_scipy():
    rng = np.random.default_rng(5)
    p, L = rng.uniform(1e4, 6e4, 20), rng.uniform(0.2, 1.0, 20)
    logs = np.log(LAW.stiffness(L, p)) + 0.1 * rng.normal(size=20)
    fitted = fit_law(p, L, np.exp(logs))

    def model(x, lnC, a, b):
        return lnC + a * x[0] + b * x[1]

    best, covariance = curve_fit(model, np.log([p, L]), logs, p0=(0.0, 1.0, 0.0))
    reach = t_distribution.ppf(0.975, 17) * np.sqrt(np.diag(covariance))
    pairs = (fitted.law, best), (fitted.low, best - reach), (fitted.high, best + reach)
    for law, expected in pairs:
        assert [np.log(law.C), law.a, law.b] == pytest.approx(expected, rel=1e-4)
    rest = logs - model(np.log([p, L]), *best)
    assert fitted.r_squared == pytest.approx(1.0 - rest.var() / logs.var(), rel=1e-6)


@pytest.mark.parametrize(('softer', 'bend'), [(0.3, 0.5), (3.0, 0.6)])
def test_points_out_of_the_linear_range_are_named(softer, bend, tmp_path, capsys):
    rows = points(bend=bend, softer=softer, count=40, noise=0.002, trials=2, seed=2)
    path = write(tmp_path, rows)
    code, out, _ = run(capsys, path)
    assert code == 0
    model = accepted(out)
    for mode in measurements.MODES:
        k = stiffness(mode, 0.508, 34.5e3)
        assert stiffness(mode, 0.508, 34.5e3, model) == pytest.approx(k, rel=0.1)
    (counted,) = re.findall(r'(\d+) of 2160 rows not used', out)
    assert 0.5 * (1.0 - bend) * 2160 < int(counted) < 1.1 * (1.0 - bend) * 2160
    named = re.findall(r'out of the linear range: (\d+), line (.*)', out)
    assert sum(int(number) for number, _ in named) == int(counted)
    # The lines that are named hold the largest displacements of their groups.
    first = named[0][1].split(', ')[0].split('-')
    assert rows[int(first[1]) - 1][3] == RANGES['axial']


def test_max_displacement_replaces_the_test_of_linearity(tmp_path, capsys):
    path = write(tmp_path, points(count=11))
    code, out, _ = run(capsys, path, '--max-displacement', 'axial=0.0151')
    assert code == 0
    assert '45 of 297 rows not used' in out
    assert 'axial, 17200 Pa, 0.254 m: beyond 0.0151 m' in out
    assert 'line 8-12' in out


def changed(column, factor, modes=measurements.MODES):
    """Return exact points with one column of some modes times a factor."""
    rows = points()
    for row in rows[1:]:
        row[column] *= factor if row[0] in modes else 1.0
    return rows


NO_MODES = 'no block for the robot file'
WRONG_UNITS = {
    'kPa': (changed(1, 1e-3), "pressure '34.5': must be from .* if it is in kPa, it is"),
    'lengths in mm': (changed(2, 1e3), "length '254.0': must be .* if it is in cm, it is 2.54 m"),
    'mm': (changed(3, 1e3), 'more than the length of the tube: must be in m'),
    'degrees': (
        changed(3, 57.3, ('rotary',)),
        'mode rotary: 90 of 108 rows .* half a turn: must be in rad; these may be degrees',
    ),
    'mN': (changed(4, 1e3), NO_MODES),
}


@pytest.mark.parametrize('unit', WRONG_UNITS)
def test_a_wrong_unit_of_a_column_is_named_and_no_block_is_printed(unit, tmp_path, capsys):
    rows, reason = WRONG_UNITS[unit]
    code, out, err = run(capsys, write(tmp_path, rows))
    assert re.search(reason, out + err)
    assert (code, NO_MODES in err, 'stiffness:' in out) == (1, True, False)


@pytest.mark.parametrize(
    ('row', 'reason'),
    [
        (['axal', 3e4, 0.5, 0.01, 1, ''], "mode 'axal': must be one of axial, transverse, "),
        (['axial', 3e4, 0.5, 0.01], '4 values for 6 columns'),
        (['axial', 3e4, 0.5, 'nan', 1, ''], "displacement 'nan': must be finite, at most 1e+12"),
        (['axial', 3e4, 0.5, '0,01', 1, ''], "displacement '0,01': must be a number"),
        (['axal', 0, 0.5, 0.01, 1, ''], "pressure '0': must be positive, at least 1e-12"),
        (['interference', 3e4, 0.5, -0.01, 1, 0.1], "displacement '-0.01': must be positive"),
        (['interference', 3e4, 0.5, 0.01, 0, 0.1], "load '0': must be positive"),
        (['interference', 3e4, 0.5, 0.01, 1, ''], "diameter '': must be a number"),
    ],
)
def test_invalid_rows_are_named_and_counted(row, reason, tmp_path, capsys):
    rows = [[*line[:5], ''] for line in points()[1:]]
    rows[4:4] = [row, row]
    code, out, _ = run(capsys, write(tmp_path, [[*HEADER, 'diameter'], *rows]))
    assert code == 0
    assert '2 of 326 rows not used' in out
    assert re.search(f'{re.escape(reason)}.*: 2, line 6-7', out)
    assert constants(accepted(out)) == pytest.approx(list(CONSTANTS.values()), rel=1e-6)


MISSING = {
    'no axial': (lambda row: row[0] != 'axial', 'no axial points: the softening of the pinched'),
    'axial alone': (lambda row: row[0] == 'axial', 'no transverse or rotary points'),
    'three groups': (lambda row: row[1:3] == [34.5e3, 0.508], '3 groups of points cannot check'),
}


@pytest.mark.parametrize('case', MISSING)
def test_undetermined_fit_is_refused_with_the_missing_points(case, tmp_path, capsys):
    keep, wanted = MISSING[case]
    header, *rows = points()
    code, out, err = run(capsys, write(tmp_path, [header, *filter(keep, rows)]))
    assert code == 1
    assert f'no block for the robot file: {wanted}' in err
    assert 'stiffness:' not in out


def test_figure_and_block_are_written_and_unknown_columns_are_named(tmp_path, capsys):
    rows = [[*row, 'x'] for row in points(noise=0.01, count=4)]
    rows[0][-1] = 'weather'
    figure, block = tmp_path / 'fit.png', tmp_path / 'block.yaml'
    path = write(tmp_path, rows)
    code, out, _ = run(capsys, path, '--figure', figure, '--block', block)
    assert code == 0
    assert 'columns not used: weather' in out
    assert accepted(block.read_text()) == accepted(out)
    assert figure.stat().st_size > 10_000
    code, _, err = run(capsys, path, '--figure', tmp_path / 'no_folder/fit.png')
    assert code == 1
    assert 'cannot be written' in err


BAD_FILES = {
    'missing': (None, 'cannot be read: No such file'),
    'column twice': (b'mode,pressure,length,displacement,load,load\n', 'once, and maybe trial'),
    'only a header': (b'mode,pressure,length,displacement,load\n', 'no points below the header'),
    'picture': (b'\x89PNG\r\n\x1a\n\x00\x00', 'byte 0: not UTF-8 text'),
    'endless cell': (b'mode,pressure,length,displacement,load\n"' + b'x' * 200_000, 'line 2'),
}


@pytest.mark.parametrize('case', BAD_FILES)
def test_invalid_file_gives_an_error_of_one_sentence(case, tmp_path, capsys):
    content, wanted = BAD_FILES[case]
    path = tmp_path / 'points.csv'
    if content is not None:
        path.write_bytes(content)
    code, out, err = run(capsys, path)
    assert (code, out) == (1, '')
    assert err.startswith(f'fit_tube_stiffness: {path}: ')
    assert len(err.splitlines()) == 1
    assert wanted in err


def test_file_that_never_ends_is_refused():
    with pytest.raises(measurements.MeasurementError, match=f'{measurements.MAX_FILE_SIZE} bytes'):
        measurements.read_measurements(Path('/dev/zero'))


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
    return measurements.Presses(*np.array(cases).T, values)


@pytest.mark.parametrize('factor', some_now([1.7, 0.4]))
def test_fit_of_loads_without_noise_returns_the_true_factor(factor):
    result = fit_local_stiffness(presses(loads(factor)), TUBE)
    assert result.value == pytest.approx(factor, rel=1e-6)
    assert result.count == len(CASES)


def test_loads_beyond_wrinkling_are_refused():
    # By hand: the wrinkling moment p pi R^3 / 2 is 4.17 N m at 20 kPa, and that is F L / 8.
    values = loads(1.7).copy()
    values[0] = 1.01 * 8.0 * (2e4 * np.pi * RADIUS**3 / 2.0) / 0.5
    with pytest.raises(measurements.MeasurementError, match=r'wrinkled at 1 of 8 .* at 66\.7 N'):
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
