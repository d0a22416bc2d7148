# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""CSV files of force gauges: columns, numbers, units and times are checked."""

from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.identification.gauge import read_gauge
import numpy as np
import pytest

ROWS = 'time_s,squeeze_N,pull_x_N,pull_y_N\n0.0,9.0,0.0,0.0\n0.5,9.5,0.1,-0.2\n'


def write(folder, text):
    """Return the path of a file with a text."""
    path = folder / 'gauge.csv'
    path.write_text(text, encoding='utf-8')
    return path


def test_forces_are_read_on_the_clock_of_the_run(tmp_path):
    gauge = read_gauge(write(tmp_path, ROWS), zero=100.0)
    assert gauge.times == pytest.approx([100.0, 100.5])
    assert gauge.squeeze == pytest.approx([9.0, 9.5])
    assert gauge.pull == pytest.approx(np.array([[0.0, 0.0], [0.1, -0.2]]))


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        (
            'time,squeeze\n0,1\n1,1\n',
            "the first line is 'time,squeeze': must name once",
        ),
        ('time_s,pull_x_N\n0,1\n1,1\n', 'must name once each'),
        ('time_s,squeeze_N\n0,1\n', '1 rows: must be at least 2'),
        ('time_s,squeeze_N\n0,1\n1,much\n', "line 3: squeeze_N 'much': must be a finite number"),
        ('time_s,squeeze_N\n0,1\n1,nan\n', 'line 3: squeeze_N'),
        ('time_s,squeeze_N\n0,1\n1,14000\n', 'if it is in mN, it is 14 N'),
        ('time_s,squeeze_N\n1,1\n2,1\n2,1\n', 'line 4: time_s 2: must be later than the 2 s'),
        ('time_s,squeeze_N\n0,1\n1\n', 'line 3: squeeze_N None'),
    ],
)
def test_an_invalid_file_is_refused_with_the_value_and_its_range(text, words, tmp_path):
    with pytest.raises(MeasurementError) as caught:
        read_gauge(write(tmp_path, text))
    assert words in str(caught.value)


def test_a_missing_file_is_refused_by_its_name(tmp_path):
    with pytest.raises(MeasurementError, match=r'none\.csv: cannot be read'):
        read_gauge(tmp_path / 'none.csv')


def test_readings_outside_of_the_run_are_refused_with_both_times(tmp_path):
    gauge = read_gauge(write(tmp_path, ROWS))
    with pytest.raises(MeasurementError, match=r'from 0.000 to 0.500 s: .* 100.000 to 120.000 s'):
        gauge.check_overlap(100.0, 120.0)
