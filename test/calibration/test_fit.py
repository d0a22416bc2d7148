# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The fit of stiffness laws: constants, output and refusals."""

from pathlib import Path
import re

from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.calibration import measurements
from isotruss_ros.calibration.beam_fit import fit_beam
from isotruss_ros.calibration.law import fit_law
from isotruss_ros.cli.fit_tube_stiffness import main
from isotruss_ros.core.model.robot_file import read_robot_file
from isotruss_ros.core.model.stiffness_law import Law
from isotruss_ros.core.statics.section import InflatableBeam
from isotruss_ros.core.statics.tube_stiffness import tube_stiffness
from measured_points import (
    CONSTANTS,
    LENGTHS,
    points,
    PRESSURES,
    RADIUS,
    RANGES,
    stiffness,
    TUBE,
    write,
)
import numpy as np
import pytest
import robots
from ruamel.yaml import YAML
from scipy.optimize import curve_fit
from scipy.stats import t as t_distribution

LAW = Law(0.5, 0.9, -0.2)


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
        (['axal', 3e4, 0.5, 0.01, 1.0], "mode 'axal': must be one of axial, transverse, rotary,"),
        (['axial', 3e4, 0.5, 0.01], '4 values for 5 columns'),
        (['axial', 3e4, 0.5, 'nan', 1.0], "displacement 'nan': must be finite, at most 1e+12"),
        (['axial', 3e4, 0.5, '0,01', 1.0], "displacement '0,01': must be a number"),
        (['axal', 0, 0.5, 0.01, 1.0], "pressure '0': must be positive, at least 1e-12"),
    ],
)
def test_invalid_rows_are_named_and_counted(row, reason, tmp_path, capsys):
    rows = [line[:5] for line in points()]
    rows[5:5] = [row, row]
    code, out, _ = run(capsys, write(tmp_path, rows))
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
