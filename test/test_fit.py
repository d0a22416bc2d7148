"""The fit of stiffness laws: what it finds, what it says, what it refuses."""

import csv
from pathlib import Path
import re
import subprocess
import sys
import tempfile
import tracemalloc
import warnings

from hypothesis import given, strategies
from isotruss_ros.core.power_law import Law
from isotruss_ros.core.robot_file import read_robot_file
from isotruss_ros.core.tube_stiffness import tube_stiffness
from isotruss_ros.fit.__main__ import main
from isotruss_ros.fit.analysis import analyse, contradiction
from isotruss_ros.fit.law import fit_law
from isotruss_ros.fit.linear_range import fit_slope
from isotruss_ros.fit.measurements import (
    MAX_FILE_SIZE,
    MeasurementError,
    MODES,
    read_measurements,
)
from isotruss_ros.fit.report import stretches
import numpy as np
from PIL import Image
import pytest
import robots
from ruamel.yaml import YAML
from scipy.optimize import curve_fit
from scipy.stats import t as t_distribution

# The paper's pressures and lengths.
PRESSURES = (17.2e3, 34.5e3, 51.7e3)
LENGTHS = (0.254, 0.508, 0.762)
LAWS = {
    'axial': Law(0.5, 0.9, -0.2),
    'transverse': Law(0.6, 0.55, -1.6),
    'rotary': Law(0.25, 0.6, 0.1),
}
RANGES = {'axial': 0.03, 'transverse': 0.08, 'rotary': 0.35}
HEADER = ['mode', 'pressure', 'length', 'displacement', 'load']


def points(laws=None, scatter=0.0, noise=0.0, trials=1, count=12, bend=1.0, softer=1.0, seed=0):
    """
    Return the rows of a CSV file, header and trial included.

    :param scatter: of the stiffness of each trial, standard deviation of its logarithm.
    :param noise: of the loads, part of the largest; each trial also has an offset of this order.
    :param bend: part of the largest displacement at which the slope changes by `softer`.
    """
    rng = np.random.default_rng(seed)
    rows = [[*HEADER, 'trial']]
    for mode, law in (laws or LAWS).items():
        for pressure in PRESSURES:
            for length in LENGTHS:
                for trial in range(trials):
                    k = law.C * pressure**law.a * length**law.b
                    k *= np.exp(scatter * rng.normal())
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


def as_process(*arguments):
    return subprocess.run(
        [sys.executable, '-m', 'isotruss_ros.fit', *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )


def accepted(text):
    """Return the model that the robot-file reader makes of a printed block."""
    (printed,) = re.findall(r'^  stiffness:.*(?:\n    .+)+', text, re.MULTILINE)
    document = robots.example()
    document['tube'] |= YAML(typ='safe', pure=True).load(printed)
    return tube_stiffness(read_robot_file(robots.write(document)))


def printed_intervals(text):
    """Return ((low, high) of C, a and b) by mode, as the table shows them."""
    number = r'(-?[\d.]+(?:e[+-]\d+)?)'
    result = {}
    for mode in MODES:
        value = re.search(rf'^{mode} +{number} +{number} +{number} ', text, re.MULTILINE)
        below = text.partition(value.group())[2].splitlines()[1]
        low, high, a, b = re.search(
            rf'{number} to {number} +± {number} +± {number}', below
        ).groups()
        middle = [float(part) for part in value.groups()]
        result[mode] = (
            (float(low), float(high)),
            (middle[1] - float(a), middle[1] + float(a)),
            (middle[2] - float(b), middle[2] + float(b)),
        )
    return result


def test_exact_points_give_the_laws_back(tmp_path, capsys):
    code, out, err = run(capsys, write(tmp_path, points()))
    assert (code, err) == (0, '')
    assert 'all 324 rows used' in out
    model = accepted(out)
    for mode, law in LAWS.items():
        assert getattr(model, mode) == pytest.approx(law, rel=1e-6)


def test_noisy_points_give_laws_within_the_printed_intervals(tmp_path, capsys):
    held = []
    for seed in range(20):
        rows = points(scatter=0.05, noise=0.01, trials=5, seed=seed)
        code, out, _ = run(capsys, write(tmp_path, rows))
        assert code == 0
        for mode, intervals in printed_intervals(out).items():
            for value, (low, high) in zip(LAWS[mode], intervals, strict=True):
                held.append(low <= value <= high)
        # Nine groups a mode, and nearly all of their 540 points.
        counts = [line.split()[-2:] for line in out.splitlines() if line.startswith(MODES)]
        assert [groups for groups, _ in counts] == ['9'] * 3
        assert all(500 < int(number) <= 540 for _, number in counts)
    # 95 % of 60 independent fits, less two standard deviations.
    assert np.mean(held) > 0.89


def test_intervals_hold_as_often_as_they_say():
    rng = np.random.default_rng(0)
    p, L = (np.ravel(grid) for grid in np.meshgrid(PRESSURES, LENGTHS))
    law = LAWS['axial']
    held = np.zeros(3)
    runs = 1000
    for _ in range(runs):
        fitted = fit_law(p, L, law.stiffness(L, p) * np.exp(0.1 * rng.normal(size=9)))
        held += [
            low <= value <= high
            for low, value, high in zip(fitted.low, law, fitted.high, strict=True)
        ]
    # Three standard deviations of a count of 95 % in 1000.
    assert held / runs == pytest.approx([0.95] * 3, abs=0.021)


def test_fit_against_scipy():
    rng = np.random.default_rng(5)
    p, L = rng.uniform(1e4, 6e4, 20), rng.uniform(0.2, 1.0, 20)
    logs = np.log(LAWS['axial'].stiffness(L, p)) + 0.1 * rng.normal(size=20)
    fitted = fit_law(p, L, np.exp(logs))

    def model(x, lnC, a, b):
        return lnC + a * x[0] + b * x[1]

    best, covariance = curve_fit(model, np.log([p, L]), logs, p0=(0.0, 1.0, 0.0))
    reach = t_distribution.ppf(0.975, 17) * np.sqrt(np.diag(covariance))
    for law, expected in (
        (fitted.law, best),
        (fitted.low, best - reach),
        (fitted.high, best + reach),
    ):
        assert [np.log(law.C), law.a, law.b] == pytest.approx(expected, rel=1e-4)
    rest = logs - model(np.log([p, L]), *best)
    assert fitted.r_squared == pytest.approx(1.0 - rest.var() / logs.var(), rel=1e-6)


@pytest.mark.parametrize(('softer', 'bend'), [(0.3, 0.5), (0.0, 0.7), (3.0, 0.6)])
def test_points_out_of_the_linear_range_are_named(softer, bend, tmp_path, capsys):
    rows = points(bend=bend, softer=softer, count=40, noise=0.002, trials=2, seed=2)
    path = write(tmp_path, rows)
    code, out, _ = run(capsys, path)
    assert code == 0
    model = accepted(out)
    for mode, law in LAWS.items():
        k = law.stiffness(np.array(0.508), np.array(34.5e3))
        found = getattr(model, mode).stiffness(np.array(0.508), np.array(34.5e3))
        assert found == pytest.approx(k, rel=0.1)
    (counted,) = re.findall(r'(\d+) of 2160 rows not used', out)
    assert 0.5 * (1.0 - bend) * 2160 < int(counted) < 1.1 * (1.0 - bend) * 2160
    named = re.findall(r'out of the linear range: (\d+), line (.*)', out)
    assert sum(int(number) for number, _ in named) == int(counted)
    # The lines that are named hold the largest displacements of their groups.
    first = named[0][1].split(', ')[0].split('-')
    assert rows[int(first[1]) - 1][3] == RANGES['axial']


def test_noise_alone_is_no_end_of_the_linear_range(tmp_path):
    measurements = read_measurements(write(tmp_path, points(noise=0.03, trials=3, seed=4)))
    assert analyse(measurements).unused.count <= 0.02 * measurements.rows


def test_max_displacement_takes_the_place_of_the_test(tmp_path, capsys):
    path = write(tmp_path, points(count=11))
    code, out, _ = run(capsys, path, '--max-displacement', 'axial=0.0151')
    assert code == 0
    assert '45 of 297 rows not used' in out
    assert 'axial, 17200 Pa, 0.254 m: beyond 0.0151 m' in out
    assert 'line 8-12' in out


def test_each_trial_has_its_own_offset(tmp_path):
    rows = [[*HEADER, 'trial']]
    for trial, offset in (('first', -4.0), ('second', 9.0)):
        rows += [['axial', 3e4, 0.5, x, offset + 200.0 * x, trial] for x in (0.0, 0.01, 0.02)]
    (group,) = read_measurements(write(tmp_path, rows)).groups
    slope = fit_slope(group)
    assert slope.stiffness == pytest.approx(200.0, rel=1e-12)
    assert slope.offsets == pytest.approx([-4.0] * 3 + [9.0] * 3)


@pytest.mark.parametrize(
    ('row', 'reason'),
    [
        (['axal', 3e4, 0.5, 0.01, 1.0], "mode 'axal': must be one of axial, transverse, rotary"),
        (['axial', 3e4, 0.5, 0.01], '4 values for 5 columns'),
        (['axial', 3e4, 0.5, 0.01, 1.0, 2.0], '6 values for 5 columns'),
        (['axial', 3e4, 0.5, 'nan', 1.0], "displacement 'nan': must be finite, at most 1e+12"),
        (['axial', 3e4, 0.5, 0.01, '-inf'], "load '-inf': must be finite, at most 1e+12"),
        (['axial', 3e4, 0.5, 0.01, '1e300'], "load '1e300': must be finite, at most 1e+12"),
        (['axial', 3e4, 0.5, 0.01, ''], "load '': must be a number"),
        (['axial', 3e4, 0.5, '0,01', 1.0], "displacement '0,01': must be a number"),
        (['axial', 0, 0.5, 0.01, 1.0], "pressure '0': must be positive"),
        (['axial', 3e4, -0.5, 0.01, 1.0], "length '-0.5': must be positive"),
        (['axal', 0, 0.5, 0.01, 1.0], "rotary; pressure '0': must be positive"),
    ],
    ids=lambda value: value if isinstance(value, str) else None,
)
def test_row_that_is_wrong_is_named_and_counted(row, reason, tmp_path, capsys):
    rows = [line[:5] for line in points()]
    rows[5:5] = [row, row]
    code, out, _ = run(capsys, write(tmp_path, rows))
    assert code == 0
    assert '2 of 326 rows not used' in out
    assert f'{reason}: 2, line 6-7' in out
    assert accepted(out).axial == pytest.approx(LAWS['axial'], rel=1e-6)


def test_group_without_a_slope_is_named_and_the_rest_is_fitted(tmp_path, capsys):
    rows = points()
    rows += [
        ['axial', 4e4, 0.5, 0.01, 10.0, 0],
        ['axial', 4e4, 0.5, 0.02, 20.0, 1],
        ['rotary', 4e4, 0.5, 0.1, -1.0, 0],
        ['rotary', 4e4, 0.5, 0.2, -2.0, 0],
        # One trial of two points gives a slope; the other has one point and adds nothing.
        ['axial', 5e4, 0.5, 0.0, 0.0, 0],
        ['axial', 5e4, 0.5, 0.02, 0.02 * 0.5 * 5e4**0.9 * 0.5**-0.2, 0],
        ['axial', 5e4, 0.5, 0.02, 99.0, 1],
    ]
    code, out, _ = run(capsys, write(tmp_path, rows))
    assert code == 0
    assert '5 of 331 rows not used' in out
    assert 'axial, 40000 Pa, 0.5 m: no trial has two displacements' in out
    assert 'rotary, 40000 Pa, 0.5 m: slope -10: must be positive' in out
    assert 'the only displacement of its trial in the linear range; a slope needs two: 1' in out
    assert accepted(out).axial == pytest.approx(LAWS['axial'], rel=1e-6)


def test_group_that_is_nowhere_linear_is_named(tmp_path):
    x = np.linspace(0.0, 0.1, 400)
    rows = [HEADER, *(['axial', 3e4, 0.5, a, 100.0 * (a / 0.1) ** 3 * a] for a in x)]
    measurements = read_measurements(write(tmp_path, rows))
    slope = fit_slope(measurements.groups[0])
    assert np.isnan(slope.stiffness)
    assert not slope.used.any()
    assert analyse(measurements).unused.count == 400


MISSING = {
    'one pressure': (
        lambda row: row[1] == 34.5e3 or row[0] != 'axial',
        ['mode axial: exponent a needs points at two or more pressures, found only 34500 Pa'],
    ),
    'one length': (
        lambda row: row[2] == 0.508 or row[0] != 'rotary',
        ['mode rotary: exponent b needs points at two or more lengths, found only 0.508 m'],
    ),
    'one of each': (
        lambda row: row[1:3] == [34.5e3, 0.508],
        ['mode axial: exponent a', 'exponent b', 'mode transverse: ', 'mode rotary: '],
    ),
    'together': (
        lambda row: PRESSURES.index(row[1]) == LENGTHS.index(row[2]) and row[2] != 0.762,
        ['pressure and length change together'],
    ),
    'three groups': (
        lambda row: row[1] < 5e4 and row[2] < 0.7 and (row[1] > 2e4 or row[2] < 0.3),
        ['3 pairs of pressure and length leave nothing to judge the fit by'],
    ),
    'no mode': (lambda row: row[0] != 'rotary', ['mode rotary: no points that can be used']),
}


@pytest.mark.parametrize('case', MISSING)
def test_fit_that_the_points_cannot_carry_is_refused_with_what_is_missing(case, tmp_path, capsys):
    keep, wanted = MISSING[case]
    header, *rows = points()
    code, out, err = run(capsys, write(tmp_path, [header, *filter(keep, rows)]))
    assert code == 1
    for part in wanted:
        assert part in err, err
    assert 'no block for the robot file' in err
    assert 'stiffness:' not in out
    # The modes that can be fitted are.
    refused = re.findall(r'no law for mode (\w+)', err)
    assert re.findall(r'^(axial|transverse|rotary) ', out, re.MULTILINE) == [
        mode for mode in MODES if mode not in refused
    ]


def test_laws_that_contradict_each_other_are_said_to(tmp_path, capsys):
    laws = LAWS | {'rotary': Law(0.01, 0.6, 0.1)}
    code, out, err = run(capsys, write(tmp_path, points(laws)))
    assert code == 0
    assert 'the three laws contradict each other within the measured range' in err
    assert re.search(r'a member of 0\.254 m at .* must be at least', err)
    accepted(out)


def test_constant_that_no_robot_file_takes_is_refused(tmp_path, capsys):
    code, _, err = run(capsys, write(tmp_path, points(LAWS | {'axial': Law(1e15, -2.0, 0.0)})))
    assert code == 1
    assert 'is no number that a robot file takes; are the units SI?' in err


def test_stiffness_that_does_not_vary_has_no_r_squared():
    p, L = np.array([1e4, 1e4, 2e4, 2e4]), np.array([0.5, 1.0, 0.5, 1.0])
    fitted = fit_law(p, L, np.full(4, 4.0))
    assert fitted.law == pytest.approx(Law(4.0, 0.0, 0.0), abs=1e-9)
    assert np.isnan(fitted.r_squared)


def test_figure_block_and_foreign_columns(tmp_path, capsys):
    rows = [[*row, 'x'] for row in points(noise=0.01, bend=0.6, softer=0.4, count=30)]
    rows[0][-1] = 'weather'
    figure, block = tmp_path / 'fit.png', tmp_path / 'block.yaml'
    path = write(tmp_path, rows)
    code, out, _ = run(capsys, path, '--figure', figure, '--block', block)
    assert code == 0
    assert 'columns not used: weather' in out
    assert accepted(block.read_text()) == accepted(out)
    with Image.open(figure) as picture:
        pixels = np.asarray(picture.convert('RGB')).astype(int)
    # One column a mode, with blue dots above and below in each.
    blue = (pixels[:, :, 2] - pixels[:, :, 0]) > 80
    for column in np.array_split(blue, 3, axis=1):
        for panel in np.array_split(column, 2):
            assert panel.sum() > 50
    for target, said in (('no_folder/fit.png', 'No such file'), ('fit.xyz', 'xyz')):
        code, _, err = run(capsys, path, '--figure', tmp_path / target)
        assert code == 1
        assert 'cannot be written' in err
        assert said in err


def test_figure_of_points_without_a_law(tmp_path, capsys):
    header, *rows = points()
    rows = [row for row in rows if row[0] == 'axial' and row[1] == 34.5e3]
    figure = tmp_path / 'fit.png'
    code, _, _ = run(capsys, write(tmp_path, [header, *rows]), '--figure', figure)
    assert code == 1
    assert figure.stat().st_size > 5000
    code, _, _ = run(capsys, write(tmp_path, [header, ['x'] * 6]), '--figure', figure)
    assert code == 1


BAD_FILES = {
    'missing': (None, 'cannot be read: No such file'),
    'empty': (b'', "the first line is ''"),
    'other header': (b'a;b\n1;2\n', "the first line is 'a;b'"),
    'column twice': (b'mode,pressure,length,displacement,load,load\n', 'once, and maybe trial'),
    'only a header': (b'mode,pressure,length,displacement,load\n', 'no points below the header'),
    'picture': (b'\x89PNG\r\n\x1a\n\x00\x00', 'byte 0: not UTF-8 text'),
    'endless cell': (b'mode,pressure,length,displacement,load\n"' + b'x' * 200_000, 'line 2'),
}


@pytest.mark.parametrize('case', BAD_FILES)
def test_bad_file_gets_one_sentence(case, tmp_path, capsys):
    content, wanted = BAD_FILES[case]
    path = tmp_path / 'points.csv'
    if content is not None:
        path.write_bytes(content)
    code, out, err = run(capsys, path)
    assert (code, out) == (1, '')
    assert err.startswith(f'fit_tube_stiffness: {path}: ')
    assert len(err.splitlines()) == 1
    assert wanted in err


def test_byte_order_mark_spaces_and_empty_lines_are_read(tmp_path):
    path = tmp_path / 'points.csv'
    path.write_bytes(
        b'\xef\xbb\xbfmode, pressure ,length,displacement,load\r\n\r\n axial , 3e4,0.5, 1,2 \r\n'
    )
    measurements = read_measurements(path)
    assert measurements.rows == 1
    (group,) = measurements.groups
    assert (group.mode, group.pressure, group.lines.tolist()) == ('axial', 3e4, [3])


def test_folder_is_no_file_of_points(tmp_path):
    with pytest.raises(MeasurementError, match='cannot be read'):
        read_measurements(tmp_path)


def test_file_that_never_ends_is_refused():
    with pytest.raises(MeasurementError, match=f'at most {MAX_FILE_SIZE} bytes'):
        read_measurements(Path('/dev/zero'))


def test_names_of_trials_cost_what_they_are_long(tmp_path):
    # As an array of texts, each would take as much as the longest: 800 MB.
    names = ['a' * 100_000, *(f't{i % 7}' for i in range(2000))]
    rows = [[*HEADER, 'trial'], *(['axial', 17200, 0.254, 0.1, 1.0, name] for name in names)]
    path = write(tmp_path, rows)
    tracemalloc.start()
    try:
        (group,) = read_measurements(path).groups
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 4 * MAX_FILE_SIZE
    # The same number for the same name.
    pairs = set(zip(group.trials.tolist(), names, strict=True))
    assert len(pairs) == len(set(names)) == 8
    assert sorted(number for number, _ in pairs) == list(range(8))


@pytest.mark.parametrize(
    'option',
    [
        ['--max-displacement', '0.1'],
        ['--max-displacement', 'axial=-1'],
        ['--tolerance', 'none'],
        ['--colour', 'red'],
    ],
    ids=' '.join,
)
def test_bad_option_is_refused_with_what_is_right(option, tmp_path, capsys):
    with pytest.raises(SystemExit) as caught:
        main(['points.csv', *option])
    assert caught.value.code == 2
    assert option[0] in capsys.readouterr().err


cells = strategies.sampled_from(
    [
        *MODES,
        '',
        'nan',
        '-0.0',
        '5e-324',
        '1e12',
        '-1e12',
        '1e-300',
        '0.5',
        '34500',
        '"',
        '#',
        '1,2',
    ]
) | strategies.floats().map(str)


@robots.examples(60)
@given(strategies.data())
def test_mutated_file_is_fitted_or_refused(data):
    """Whatever stands in a file, each of its rows is used or counted, and no warning escapes."""
    header, *rows = points(count=4, noise=0.01, trials=2)
    for _ in range(data.draw(strategies.integers(1, 8))):
        row = data.draw(strategies.sampled_from(rows))
        column = data.draw(strategies.integers(0, 5))
        value = data.draw(cells)
        for other in rows if data.draw(strategies.booleans()) else [row]:
            other[column] = value
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter('error')
        measurements = read_measurements(write(Path(folder), [header, *rows]))
        analysis = analyse(measurements)
        contradiction(analysis)
    used = sum(analysis.points(mode) for mode in MODES)
    assert used + analysis.unused.count == measurements.rows == len(rows)
    for mode, law in analysis.laws.items():
        assert np.isfinite(law.law).all(), mode


def test_stretches():
    assert stretches([3, 4, 5, 9, 11, 12]) == '3-5, 9, 11-12'


def test_as_a_process(tmp_path):
    done = as_process(write(tmp_path, points()), '--figure', tmp_path / 'fit.svg')
    assert (done.returncode, done.stderr) == (0, '')
    accepted(done.stdout)
    assert (tmp_path / 'fit.svg').read_text().startswith('<?xml')
    bad = as_process(tmp_path / 'nowhere.csv')
    assert (bad.returncode, bad.stdout) == (1, '')
    assert 'Traceback' not in bad.stderr
    assert len(bad.stderr.splitlines()) == 1
